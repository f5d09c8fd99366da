/* A peer on Cyclone DDS. Messages pass through it as bytes, so it takes any type. See peer.h.
 *
 *   cc -O2 -o cyclone cyclone.c -lddsc
 */
#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include "peer.h"

/* ---- a message as it stands on the wire ---- */

struct raw {
  struct ddsi_serdata c;
  uint32_t size;
  uint8_t *bytes;
};

static struct raw *raw_new(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind, size_t size) {
  struct raw *d = malloc(sizeof *d);
  ddsi_serdata_init(&d->c, type, kind);
  d->size = (uint32_t)size;
  d->bytes = calloc(1, size + 4);
  return d;
}

static struct ddsi_serdata *raw_from_ser(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                         const struct nn_rdata *chain, size_t size) {
  struct raw *d = raw_new(type, kind, size);
  uint32_t at = 0;
  for (; chain; chain = chain->nextfrag) {
    if (chain->maxp1 <= at) continue;
    const unsigned char *payload = NN_RMSG_PAYLOADOFF(chain->rmsg, NN_RDATA_PAYLOAD_OFF(chain));
    memcpy(d->bytes + at, payload + (at - chain->min), chain->maxp1 - at);
    at = chain->maxp1;
  }
  return &d->c;
}

static struct ddsi_serdata *raw_from_iov(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                         ddsrt_msg_iovlen_t count, const ddsrt_iovec_t *iov, size_t size) {
  struct raw *d = raw_new(type, kind, size);
  size_t at = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count && at < size; i++) {
    const size_t length = iov[i].iov_len < size - at ? iov[i].iov_len : size - at;
    memcpy(d->bytes + at, iov[i].iov_base, length);
    at += length;
  }
  return &d->c;
}

static struct ddsi_serdata *raw_from_keyhash(const struct ddsi_sertype *type, const struct ddsi_keyhash *hash) {
  (void)hash;
  return &raw_new(type, SDK_KEY, 0)->c;
}

static struct ddsi_serdata *raw_from_sample(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                            const void *sample) {
  (void)sample;
  return &raw_new(type, kind, 0)->c;
}

static uint32_t raw_size(const struct ddsi_serdata *c) { return ((const struct raw *)c)->size; }

static void raw_to_ser(const struct ddsi_serdata *c, size_t off, size_t size, void *out) {
  memcpy(out, ((const struct raw *)c)->bytes + off, size);
}

static struct ddsi_serdata *raw_to_ser_ref(const struct ddsi_serdata *c, size_t off, size_t size,
                                           ddsrt_iovec_t *ref) {
  ref->iov_base = ((const struct raw *)c)->bytes + off;
  ref->iov_len = size;
  return ddsi_serdata_ref(c);
}

static void raw_to_ser_unref(struct ddsi_serdata *c, const ddsrt_iovec_t *ref) {
  (void)ref;
  ddsi_serdata_unref(c);
}

static bool raw_to_sample(const struct ddsi_serdata *c, void *sample, void **at, void *end) {
  (void)c, (void)sample, (void)at, (void)end;
  return true;
}

static bool raw_untyped_to_sample(const struct ddsi_sertype *type, const struct ddsi_serdata *c, void *sample,
                                  void **at, void *end) {
  (void)type;
  return raw_to_sample(c, sample, at, end);
}

static struct ddsi_serdata *raw_to_untyped(const struct ddsi_serdata *c) {
  struct raw *d = raw_new(c->type, SDK_KEY, 0);
  d->c.type = NULL;
  return &d->c;
}

static bool raw_eqkey(const struct ddsi_serdata *a, const struct ddsi_serdata *b) {
  (void)a, (void)b;
  return true;
}

static void raw_free(struct ddsi_serdata *c) {
  free(((struct raw *)c)->bytes);
  free(c);
}

static size_t raw_print(const struct ddsi_sertype *type, const struct ddsi_serdata *c, char *out, size_t size) {
  (void)type, (void)c;
  return (size_t)snprintf(out, size, "raw");
}

static void raw_keyhash(const struct ddsi_serdata *c, struct ddsi_keyhash *out, bool force_md5) {
  (void)c, (void)force_md5;
  memset(out, 0, sizeof *out);
}

static const struct ddsi_serdata_ops RAW = {
    .eqkey = raw_eqkey, .get_size = raw_size, .from_ser = raw_from_ser, .from_ser_iov = raw_from_iov,
    .from_keyhash = raw_from_keyhash, .from_sample = raw_from_sample, .to_ser = raw_to_ser,
    .to_ser_ref = raw_to_ser_ref, .to_ser_unref = raw_to_ser_unref, .to_sample = raw_to_sample,
    .to_untyped = raw_to_untyped, .untyped_to_sample = raw_untyped_to_sample, .free = raw_free,
    .print = raw_print, .get_keyhash = raw_keyhash};

static void type_free(struct ddsi_sertype *type) {
  ddsi_sertype_fini(type);
  free(type);
}

static bool type_equal(const struct ddsi_sertype *a, const struct ddsi_sertype *b) {
  (void)a, (void)b;
  return true;
}

static uint32_t type_hash(const struct ddsi_sertype *type) {
  (void)type;
  return 0;
}

static const struct ddsi_sertype_ops RAW_TYPE = {
    .version = ddsi_sertype_v0, .free = type_free, .equal = type_equal, .hash = type_hash};

/* ---- endpoints ---- */

static dds_entity_t check(dds_return_t result, const char *what) {
  if (result < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(-result));
    exit(1);
  }
  return result;
}

static struct ddsi_sertype *open_topic(dds_entity_t participant, const char *name, const char *type_name,
                                       dds_entity_t *topic) {
  struct ddsi_sertype *type = calloc(1, sizeof *type);
  ddsi_sertype_init(type, type_name, &RAW_TYPE, &RAW, true);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  *topic = check(dds_create_topic_sertype(participant, name, &type, NULL, NULL, NULL), "topic");
  return type;
}

static dds_qos_t *new_qos(const struct options *o) {
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, o->is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_SECS(10));
  dds_qset_durability(qos, o->is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, o->depth);
  dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &xcdr1);
  return qos;
}

static void await(dds_entity_t entity, uint32_t status, double seconds) {
  dds_entity_t set = dds_create_waitset(DDS_CYCLONEDDS_HANDLE);
  dds_set_status_mask(entity, status);
  dds_waitset_attach(set, entity, 0);
  if (dds_waitset_wait(set, NULL, 0, (dds_duration_t)(seconds * 1e9)) <= 0) fail("nobody came");
  dds_delete(set);
}

static void write_raw(dds_entity_t writer, const struct ddsi_sertype *type, const uint8_t *message, size_t length) {
  struct raw *d = raw_new(type, SDK_DATA, length);
  memcpy(d->bytes, message, length);
  d->c.timestamp.v = dds_time();
  check(dds_writecdr(writer, &d->c), "write");
}

static void publish(const struct options *o, dds_entity_t participant) {
  dds_entity_t topic;
  const struct ddsi_sertype *type = open_topic(participant, o->topic, o->type, &topic);
  dds_entity_t writer = check(dds_create_writer(participant, topic, new_qos(o), NULL), "writer");
  await(writer, DDS_PUBLICATION_MATCHED_STATUS, o->seconds);
  say("matched");
  hold(o);
  size_t length;
  uint8_t *image = new_image(o, &length);
  const int64_t started = wall_ns();
  for (int i = 0; i < o->count; i++) {
    sleep_until_ns(started + (int64_t)(i * 1e9 / o->rate));
    stamp(image);
    write_raw(writer, type, image, length);
  }
  report_sent(o->count, started);
  if (o->is_reliable) dds_wait_for_acks(writer, DDS_SECS(10));
  dds_sleepfor((dds_duration_t)(o->linger * 1e9));
}

static int take(dds_entity_t reader, struct raw **taken) {
  struct ddsi_serdata *serdata;
  dds_sample_info_t info;
  while (dds_takecdr(reader, &serdata, 1, &info, DDS_ANY_STATE) == 1) {
    if (info.valid_data) {
      *taken = (struct raw *)serdata;
      return 1;
    }
    ddsi_serdata_unref(serdata);
  }
  return 0;
}

static void subscribe(const struct options *o, dds_entity_t participant) {
  dds_entity_t topic;
  open_topic(participant, o->topic, o->type, &topic);
  dds_entity_t reader = check(dds_create_reader(participant, topic, new_qos(o), NULL), "reader");
  await(reader, DDS_SUBSCRIPTION_MATCHED_STATUS, o->seconds);
  say("matched");
  struct tally tally = {0};
  dds_entity_t set = dds_create_waitset(participant);
  dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS);
  dds_waitset_attach(set, reader, 0);
  const int64_t end = wall_ns() + (int64_t)(o->seconds * 1e9);
  while (tally.count < o->count && wall_ns() < end) {
    dds_waitset_wait(set, NULL, 0, DDS_MSECS(100));
    for (struct raw *d; take(reader, &d); ddsi_serdata_unref(&d->c)) enter(&tally, d->bytes, d->size);
  }
  report(&tally);
}

/* The reply that begins as the request does; null if the time is over. */
static struct raw *wait_for_reply(dds_entity_t reader, const uint8_t *request, int64_t end_ns) {
  while (wall_ns() < end_ns) {
    struct raw *reply;
    if (!take(reader, &reply)) {
      dds_sleepfor(DDS_MSECS(1));
    } else if (reply->size >= 20 && !memcmp(reply->bytes + 4, request + 4, 16)) {
      return reply;
    } else {
      // Replies to others come by the same topic.
      ddsi_serdata_unref(&reply->c);
    }
  }
  return NULL;
}

static void discover(const struct options *o, dds_entity_t participant) {
  dds_entity_t reader = check(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, NULL, NULL), "reader");
  const int64_t end = wall_ns() + (int64_t)(o->seconds * 1e9);
  while (wall_ns() < end) {
    void *samples[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(reader, samples, &info, 1, 1) != 1) {
      dds_sleepfor(DDS_MSECS(10));
      continue;
    }
    const dds_builtintopic_endpoint_t *found = samples[0];
    if (info.valid_data && !strcmp(found->topic_name, o->topic)) {
      void *user_data = NULL;
      size_t length = 0;
      dds_qget_userdata(found->qos, &user_data, &length);
      report_publisher(found->type_name, user_data, length);
      return;
    }
    dds_return_loan(reader, samples, 1);
  }
  fail("nobody came");
}

/* As rmw_cyclonedds does: eight bytes of client and eight of number in front of request and reply. */
static void call(struct options *o, dds_entity_t participant, int is_single) {
  char requests[256], replies[256], request_type[256], reply_type[256];
  snprintf(requests, sizeof requests, "rq%sRequest", o->topic);
  snprintf(replies, sizeof replies, "rr%sReply", o->topic);
  snprintf(request_type, sizeof request_type, "%sRequest_", o->type);
  snprintf(reply_type, sizeof reply_type, "%sResponse_", o->type);
  o->is_reliable = 1;
  dds_entity_t request_topic, reply_topic;
  const struct ddsi_sertype *type = open_topic(participant, requests, request_type, &request_topic);
  open_topic(participant, replies, reply_type, &reply_topic);
  dds_entity_t reader = check(dds_create_reader(participant, reply_topic, new_qos(o), NULL), "reader");
  dds_entity_t writer = check(dds_create_writer(participant, request_topic, new_qos(o), NULL), "writer");
  await(writer, DDS_PUBLICATION_MATCHED_STATUS, o->seconds);
  await(reader, DDS_SUBSCRIPTION_MATCHED_STATUS, o->seconds);
  static uint8_t request[1 << 16] = {0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8};
  const size_t length = 16 + parse_hex(o->request + 8, request + 20, sizeof request - 20) + 4;
  struct tally answered = {0};
  for (int number = 1; number <= (is_single ? 1 : o->count); number++) {
    request[12] = (uint8_t)number;
    const int64_t sent_ns = wall_ns();
    write_raw(writer, type, request, length);
    struct raw *reply = wait_for_reply(reader, request, sent_ns + (int64_t)(o->seconds * 1e9));
    if (!reply) continue;
    enter_since(&answered, sent_ns, reply->size - 16);
    if (is_single) report_reply(reply->bytes + 20, reply->size - 20);
    ddsi_serdata_unref(&reply->c);
  }
  if (is_single && !answered.count) fail("no reply");
  if (!is_single) report_as("replies", &answered);
}

int main(int argc, char **argv) {
  struct options o = parse(argc, argv);
  dds_entity_t participant = check(dds_create_participant((uint32_t)o.domain, NULL, NULL), "participant");
  if (!strcmp(o.verb, "publish")) publish(&o, participant);
  else if (!strcmp(o.verb, "subscribe")) subscribe(&o, participant);
  else if (!strcmp(o.verb, "discover")) discover(&o, participant);
  else if (!strcmp(o.verb, "call")) call(&o, participant, 1);
  else if (!strcmp(o.verb, "calls")) call(&o, participant, 0);
  else fail("publish, subscribe, discover, call or calls");
  dds_delete(participant);
  return 0;
}
