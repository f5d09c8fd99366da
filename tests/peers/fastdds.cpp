// A peer on Fast DDS, with its stock settings. Messages pass through it as bytes, so it takes any type. See peer.h.
//
//   c++ -O2 -o fastdds fastdds.cpp -lfastrtps -lfastcdr
#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>

#include "peer.h"

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::rtps::WriteParams;
using Bytes = std::vector<uint8_t>;

// Larger messages exist, but none is sent or expected here.
constexpr uint32_t MAX_BYTES = 64 << 20;

class Raw : public TopicDataType {
 public:
  explicit Raw(const std::string& name) {
    setName(name.c_str());
    m_typeSize = MAX_BYTES;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& message = *static_cast<Bytes*>(data);
    if (payload->max_size < message.size()) return false;
    memcpy(payload->data, message.data(), message.size());
    payload->length = static_cast<uint32_t>(message.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

// Waits for events of the middleware's own threads.
class Event {
 public:
  void set() {
    std::lock_guard<std::mutex> lock(mutex_);
    is_set_ = true;
    changed_.notify_all();
  }
  bool wait(double seconds) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return is_set_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_set_ = false;
};

struct WriterEvents : DataWriterListener {
  Event matched;
  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    if (status.current_count > 0) matched.set();
  }
};

struct ReaderEvents : DataReaderListener {
  Event matched, done;
  std::mutex mutex;
  tally received{};
  int wanted = 0;
  Bytes last;
  SampleInfo info;
  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    if (status.current_count > 0) matched.set();
  }
  void on_data_available(DataReader* reader) override {
    std::lock_guard<std::mutex> lock(mutex);
    while (reader->take_next_sample(&last, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      enter(&received, last.data(), last.size());
      if (received.count >= wanted) {
        done.set();
        return;
      }
    }
  }
};

// Replies by the number of their request.
struct ReplyEvents : DataReaderListener {
  Event matched;
  std::mutex mutex;
  std::condition_variable changed;
  std::map<uint64_t, Bytes> replies;
  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    if (status.current_count > 0) matched.set();
  }
  void on_data_available(DataReader* reader) override {
    std::lock_guard<std::mutex> lock(mutex);
    Bytes reply;
    SampleInfo info;
    while (reader->take_next_sample(&reply, &info) == ReturnCode_t::RETCODE_OK) {
      const auto& to = info.related_sample_identity;
      // Replies to others come by the same topic.
      if (!info.valid_data || to.writer_guid() != reader->guid()) continue;
      replies[to.sequence_number().to64long()] = reply;
      changed.notify_all();
    }
  }
  // Whether the reply to a request has come; it is forgotten then.
  bool wait(uint64_t request, double seconds, Bytes* reply) {
    std::unique_lock<std::mutex> lock(mutex);
    const auto is_there = [&] { return replies.count(request) > 0; };
    if (!changed.wait_for(lock, std::chrono::duration<double>(seconds), is_there)) return false;
    *reply = replies[request];
    replies.erase(request);
    return true;
  }
};

struct Publishers : DomainParticipantListener {
  Event found;
  std::string topic;
  void on_publisher_discovery(DomainParticipant*, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override {
    if (info.info.topicName() != topic.c_str()) return;
    const auto& user_data = info.info.m_qos.m_userData;
    report_publisher(info.info.typeName().c_str(), user_data.data(), user_data.size());
    found.set();
  }
};

struct Node {
  DomainParticipant* participant;
  // Before the listeners go.
  void leave() {
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
  }
  explicit Node(const options& o)
      : participant(DomainParticipantFactory::get_instance()->create_participant(o.domain, PARTICIPANT_QOS_DEFAULT)) {
    if (!participant) fail("participant");
  }
  Topic* topic(const std::string& name, const std::string& type) {
    TypeSupport(new Raw(type)).register_type(participant);
    return participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
  }
  template <class Qos>
  static void set(Qos& qos, const options& o) {
    qos.reliability().kind = o.is_reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = o.is_latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = o.depth;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  }
  DataWriter* writer(Topic* topic, const options& o, WriterEvents* events) {
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    set(qos, o);
    // Synchronous writers send no message that must be cut into fragments.
    qos.publish_mode().kind = ASYNCHRONOUS_PUBLISH_MODE;
    auto* writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos, events);
    if (!writer) fail("writer");
    return writer;
  }
  DataReader* reader(Topic* topic, const options& o, DataReaderListener* events) {
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    set(qos, o);
    auto* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos, events);
    if (!reader) fail("reader");
    return reader;
  }
};

static void publish(const options& o, Node& node) {
  WriterEvents events;
  auto* writer = node.writer(node.topic(o.topic, o.type), o, &events);
  if (!events.matched.wait(o.seconds)) fail("nobody came");
  say("matched");
  hold(&o);
  size_t length;
  uint8_t* image = new_image(&o, &length);
  Bytes message(image, image + length);
  const int64_t started = wall_ns();
  for (int i = 0; i < o.count; i++) {
    sleep_until_ns(started + static_cast<int64_t>(i * 1e9 / o.rate));
    stamp(message.data());
    if (!writer->write(&message)) fail("write");
  }
  report_sent(o.count, started);
  if (o.is_reliable) writer->wait_for_acknowledgments({10, 0});
  sleep_until_ns(wall_ns() + static_cast<int64_t>(o.linger * 1e9));
  node.leave();
}

static void subscribe(const options& o, Node& node) {
  ReaderEvents events;
  events.wanted = o.count;
  node.reader(node.topic(o.topic, o.type), o, &events);
  if (!events.matched.wait(o.seconds)) fail("nobody came");
  say("matched");
  events.done.wait(o.seconds);
  node.leave();
  report(&events.received);
}

static void discover(const options& o) {
  Publishers publishers;
  publishers.topic = o.topic;
  auto* factory = DomainParticipantFactory::get_instance();
  auto* participant =
      factory->create_participant(o.domain, PARTICIPANT_QOS_DEFAULT, &publishers, StatusMask::none());
  if (!participant) fail("participant");
  if (!publishers.found.wait(o.seconds)) fail("nobody came");
  factory->delete_participant(participant);
}

// As rmw_fastrtps does: beside the request stands the reader of the reply, beside the reply that and the request's number.
static void call(options o, Node& node, bool is_single) {
  const std::string topic = o.topic, type = o.type;
  o.is_reliable = 1;
  ReplyEvents replies;
  WriterEvents requests;
  auto* reader = node.reader(node.topic("rr" + topic + "Reply", type + "Response_"), o, &replies);
  auto* writer = node.writer(node.topic("rq" + topic + "Request", type + "Request_"), o, &requests);
  if (!requests.matched.wait(o.seconds) || !replies.matched.wait(o.seconds)) fail("nobody came");
  Bytes request(strlen(o.request) / 2), reply;
  request.resize(parse_hex(o.request, request.data(), request.size()));
  tally answered{};
  for (int i = 0; i < (is_single ? 1 : o.count); i++) {
    WriteParams params;
    params.related_sample_identity().writer_guid() = reader->guid();
    const int64_t sent_ns = wall_ns();
    if (!writer->write(&request, params)) fail("write");
    if (replies.wait(params.sample_identity().sequence_number().to64long(), o.seconds, &reply)) {
      enter_since(&answered, sent_ns, reply.size());
    }
  }
  node.leave();
  if (is_single && !answered.count) fail("no reply");
  if (is_single) report_reply(reply.data(), reply.size());
  else report_as("replies", &answered);
}

int main(int argc, char** argv) {
  const options o = parse(argc, argv);
  const std::string verb = o.verb;
  if (verb == "discover") {
    discover(o);
    return 0;
  }
  Node node(o);
  if (verb == "publish") publish(o, node);
  else if (verb == "subscribe") subscribe(o, node);
  else if (verb == "call" || verb == "calls") call(o, node, verb == "call");
  else fail("publish, subscribe, discover, call or calls");
}
