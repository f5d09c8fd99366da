//! Schema and channel records, and the topics they make.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use mcap::records::op;

use super::fields::Fields;
use super::rewrite::Rewrite;
use super::{Topic, ros1, type_name};

/// Key of a channel's metadata that holds the type hash.
pub(super) const TYPE_HASH_KEY: &str = "topic_type_hash";
/// Key of a channel's metadata that holds the quality of service.
pub(super) const QOS_KEY: &str = "offered_qos_profiles";

/// Longest name of a topic, a type or an encoding: ROS allows 256 bytes.
const MAX_NAME_BYTES: usize = 4096;
/// Limit on the size of all schemas and topics, bytes. Every topic holds a copy of its schema, and 65535 topics may
/// share one schema.
const MAX_BYTES: usize = 64 << 20;

/// Channels and schemas defined by a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, Schema>,
    topics: BTreeMap<u16, Arc<Topic>>,
    /// Channels whose messages are rewritten.
    rewrites: BTreeMap<u16, Rewrite>,
    /// Metadata of the channels without the entries that a topic holds.
    further: BTreeMap<u16, BTreeMap<String, String>>,
    bytes: usize,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Schema {
    name: String,
    encoding: String,
    data: Arc<[u8]>,
}

/// The content that files of a bag have in common.
#[derive(Debug, Default)]
pub(super) struct Known {
    pub(super) topics: BTreeSet<Arc<Topic>>,
    schemas: BTreeSet<Arc<[u8]>>,
}

impl Channels {
    /// The topic of a channel.
    pub(super) fn get(&self, channel: u16) -> Option<&Arc<Topic>> {
        self.topics.get(&channel)
    }

    /// How the messages of a channel are rewritten; `None` if they are not.
    pub(super) fn rewrite(&self, channel: u16) -> Option<Rewrite> {
        self.rewrites.get(&channel).copied()
    }

    /// Entries of a channel's metadata that its topic does not hold.
    pub(super) fn further(&self, channel: u16) -> impl Iterator<Item = (&str, &str)> {
        let entries = self.further.get(&channel).into_iter().flatten();
        entries.map(|(key, text)| (key.as_str(), text.as_str()))
    }

    /// Channels and their topics, by number.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u16, &Arc<Topic>)> {
        self.topics.iter().map(|(id, topic)| (*id, topic))
    }

    /// Adds a schema or channel record; any other record is ignored. A repeated definition is normal. A different one
    /// under the same number is an error, and the first definition stays.
    pub(super) fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode != op::SCHEMA && opcode != op::CHANNEL {
            return Ok(());
        }
        let mut fields = Fields::of(body);
        let malformed = "a malformed schema or channel record";
        if opcode == op::SCHEMA {
            let (id, schema) = schema_of(&mut fields).ok_or(malformed)?;
            self.add_schema(id, schema)
        } else {
            self.add_channel(channel_of(&mut fields).ok_or(malformed)?)
        }
    }

    fn add_schema(&mut self, id: u16, new: Schema) -> Result<(), String> {
        check_names([&new.name, &new.encoding])?;
        match self.schemas.get(&id) {
            Some(schema) if *schema == new => Ok(()),
            Some(schema) => {
                Err(format!("schema {id} is defined twice, by {} and {}", schema.name, new.name))
            }
            None => self.make_room(new.data.len()).map(|()| drop(self.schemas.insert(id, new))),
        }
    }

    fn add_channel(&mut self, channel: Channel) -> Result<(), String> {
        let Channel { id, schema_id, name, encoding, mut metadata } = channel;
        check_names([&name, &encoding])?;
        let schema = self.schemas.get(&schema_id);
        if schema.is_none() && schema_id != 0 {
            return Err(format!("{name}: its schema {schema_id} is missing"));
        }
        let mut new = topic(&name, &encoding, schema, &mut metadata);
        let rewrite = Rewrite::adopt(&mut new);
        match self.topics.get(&id) {
            Some(topic) if **topic == new => Ok(()),
            Some(topic) => {
                Err(format!("channel {id} is defined twice, as {} and {}", topic.name, new.name))
            }
            None => {
                let entries_bytes = metadata.iter().map(|(key, text)| key.len() + text.len());
                self.make_room(size_bytes(&new) + entries_bytes.sum::<usize>())?;
                if !metadata.is_empty() {
                    self.further.insert(id, metadata);
                }
                self.topics.insert(id, Arc::new(new));
                self.rewrites.extend(rewrite.map(|rewrite| (id, rewrite)));
                Ok(())
            }
        }
    }

    /// Returns the memory of the schemas and topics that a bag does not know yet, bytes.
    pub(super) fn new_bytes(&self, known: &Known) -> usize {
        let schemas = self.schemas.values().map(|schema| &schema.data);
        let schemas = schemas.filter(|data| !known.schemas.contains(*data)).map(|data| data.len());
        let topics = self.topics.values().filter(|topic| !known.topics.contains(*topic));
        let entries = self.further.values().flatten().map(|(key, text)| key.len() + text.len());
        schemas.chain(topics.map(|topic| size_bytes(topic))).chain(entries).sum()
    }

    /// Shares the schemas and topics that a bag knows already, and adds the others to them.
    pub(super) fn share(&mut self, known: &mut Known) {
        for Schema { data, .. } in self.schemas.values_mut() {
            *data = shared(data, &mut known.schemas);
        }
        for topic in self.topics.values_mut() {
            *topic = shared(topic, &mut known.topics);
        }
    }

    /// Refuses content beyond the limit.
    fn make_room(&mut self, bytes: usize) -> Result<(), String> {
        let sum = self.bytes.saturating_add(bytes);
        if sum > MAX_BYTES {
            return Err(format!("schemas and channels take more than {MAX_BYTES} bytes"));
        }
        self.bytes = sum;
        Ok(())
    }
}

fn shared<T: Ord + ?Sized>(new: &Arc<T>, known: &mut BTreeSet<Arc<T>>) -> Arc<T> {
    if let Some(shared) = known.get(new) {
        return Arc::clone(shared);
    }
    known.insert(Arc::clone(new));
    Arc::clone(new)
}

fn size_bytes(topic: &Topic) -> usize {
    let Topic { name, type_name, message_encoding, schema_encoding, schema, type_hash, qos } =
        topic;
    let texts = [name, type_name, message_encoding, schema_encoding, type_hash, qos];
    texts.map(String::len).iter().sum::<usize>() + schema.len()
}

fn check_names(names: [&str; 2]) -> Result<(), String> {
    match names.into_iter().find(|name| name.len() > MAX_NAME_BYTES) {
        Some(name) => {
            Err(format!("a name of {} bytes exceeds the limit of {MAX_NAME_BYTES}", name.len()))
        }
        None => Ok(()),
    }
}

/// Returns the topic of a channel. Takes its entries out of the metadata.
fn topic(
    name: &str,
    encoding: &str,
    schema: Option<&Schema>,
    metadata: &mut BTreeMap<String, String>,
) -> Topic {
    let mut entry = |key| metadata.remove(key).unwrap_or_default();
    // Names of other encodings, such as JSON, are not names of ROS.
    let is_ros = ["cdr", ros1::ENCODING].contains(&encoding);
    let type_name = |schema: &Schema| {
        if is_ros { type_name::of_ros_2(&schema.name) } else { schema.name.clone() }
    };
    Topic {
        name: name.into(),
        type_name: schema.map_or_else(String::new, type_name),
        message_encoding: encoding.into(),
        schema_encoding: schema.map_or_else(String::new, |schema| schema.encoding.clone()),
        schema: schema.map_or_else(Vec::new, |schema| schema.data.to_vec()),
        type_hash: entry(TYPE_HASH_KEY),
        qos: entry(QOS_KEY),
    }
}

/// Returns the schema of a record and its number; `None` for malformed fields.
fn schema_of(fields: &mut Fields<'_>) -> Option<(u16, Schema)> {
    let id = fields.u16()?;
    let (name, encoding) = (fields.string()?, fields.string()?);
    let length = fields.u32()?;
    Some((id, Schema { name, encoding, data: fields.bytes(length.into())?.into() }))
}

/// Returns the channel of a record; `None` for malformed fields.
fn channel_of(fields: &mut Fields<'_>) -> Option<Channel> {
    let (id, schema_id) = (fields.u16()?, fields.u16()?);
    let (name, encoding) = (fields.string()?, fields.string()?);
    Some(Channel { id, schema_id, name, encoding, metadata: fields.string_map()? })
}

/// A channel as its record states it.
struct Channel {
    id: u16,
    schema_id: u16,
    name: String,
    encoding: String,
    metadata: BTreeMap<String, String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &[u8]) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text].concat()
    }

    fn schema(id: u16, name: &str, data: &[u8]) -> Vec<u8> {
        [id.to_le_bytes().to_vec(), text(name.as_bytes()), text(b"ros2msg"), text(data)].concat()
    }

    fn channel(id: u16, schema: u16, name: &str) -> Vec<u8> {
        let numbers = [id.to_le_bytes(), schema.to_le_bytes()].concat();
        [numbers, text(name.as_bytes()), text(b"cdr"), vec![0; 4]].concat()
    }

    #[test]
    fn many_channels_of_one_large_schema_take_bounded_memory() {
        let mut channels = Channels::default();
        channels.add(op::SCHEMA, &schema(1, "a/msg/A", &vec![b' '; 1 << 20])).unwrap();
        let added = (0..u16::MAX)
            .map(|id| channels.add(op::CHANNEL, &channel(id, 1, &format!("/t{id}"))))
            .take_while(Result::is_ok);
        assert_eq!(added.count(), 62, "64 MiB with the schema itself and the names");
        let again = channels.add(op::CHANNEL, &channel(5, 1, "/t5"));
        assert_eq!(again, Ok(()), "a repeated definition takes no memory");
        let refused = channels.add(op::CHANNEL, &channel(99, 1, "/t99")).unwrap_err();
        assert!(refused.contains("more than 67108864 bytes"), "{refused}");
    }

    #[test]
    fn files_of_a_bag_share_what_they_have_in_common() {
        let file = |name: &str| {
            let mut channels = Channels::default();
            channels.add(op::SCHEMA, &schema(1, "a/msg/A", &[b' '; 1000])).unwrap();
            channels.add(op::CHANNEL, &channel(1, 1, name)).unwrap();
            channels
        };
        let mut known = Known::default();
        let [mut first, mut second] = ["/a", "/a"].map(file);
        assert!(first.new_bytes(&known) > 2000);
        first.share(&mut known);
        assert_eq!(second.new_bytes(&known), 0);
        second.share(&mut known);
        assert!(Arc::ptr_eq(first.get(1).unwrap(), second.get(1).unwrap()));
        assert!(Arc::ptr_eq(&first.schemas[&1].data, &second.schemas[&1].data));
        let other = file("/other").new_bytes(&known);
        assert!((1000..2000).contains(&other), "the topic with its copy of the schema: {other}");
    }

    #[test]
    fn every_channel_number_can_be_used() {
        let mut channels = Channels::default();
        channels.add(op::SCHEMA, &schema(1, "a/msg/A", b"int32 a")).unwrap();
        for id in 0..=u16::MAX {
            channels.add(op::CHANNEL, &channel(id, 1, &format!("/t{id}"))).unwrap();
        }
        assert_eq!(channels.iter().count(), 65_536);
    }

    #[test]
    fn a_name_longer_than_the_limit_is_refused() {
        let long = "x".repeat(4097);
        let mut channels = Channels::default();
        assert!(channels.add(op::SCHEMA, &schema(1, &long, b"")).unwrap_err().contains("4097"));
        assert!(channels.add(op::CHANNEL, &channel(1, 0, &long)).unwrap_err().contains("4097"));
        assert!(channels.add(op::CHANNEL, &channel(1, 0, &long[1..])).is_ok());
    }

    #[test]
    fn the_first_of_two_definitions_stays() {
        let mut channels = Channels::default();
        channels.add(op::CHANNEL, &channel(1, 0, "/a")).unwrap();
        let twice = channels.add(op::CHANNEL, &channel(1, 0, "/b")).unwrap_err();
        assert_eq!(twice, "channel 1 is defined twice, as /a and /b");
        assert_eq!(channels.get(1).unwrap().name, "/a");
        let missing = channels.add(op::CHANNEL, &channel(2, 9, "/c")).unwrap_err();
        assert_eq!(missing, "/c: its schema 9 is missing");
    }
}
