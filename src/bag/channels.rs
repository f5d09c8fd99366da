//! Schema and channel records, and the topics they make.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records::op;

use super::Topic;
use super::fields::Fields;

/// Key of a channel's metadata that holds the type hash.
pub(super) const TYPE_HASH_KEY: &str = "topic_type_hash";
/// Key of a channel's metadata that holds the quality of service.
pub(super) const QOS_KEY: &str = "offered_qos_profiles";

/// What a file has said about its channels.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, Schema>,
    topics: BTreeMap<u16, Arc<Topic>>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Schema {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

impl Channels {
    /// The topic of a channel.
    pub(super) fn get(&self, channel: u16) -> Option<&Arc<Topic>> {
        self.topics.get(&channel)
    }

    /// Channels and their topics, by number.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u16, &Arc<Topic>)> {
        self.topics.iter().map(|(id, topic)| (*id, topic))
    }

    /// Takes a schema or channel record; any other is passed over. The same twice is normal, something else under the
    /// same number is not: the first stays.
    pub(super) fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode != op::SCHEMA && opcode != op::CHANNEL {
            return Ok(());
        }
        let mut fields = Fields::of(body);
        let added = if opcode == op::SCHEMA {
            self.add_schema(&mut fields)
        } else {
            self.add_channel(&mut fields)
        };
        added.ok_or("a schema or channel record whose fields do not fit")?
    }

    /// `None` for ill-formed fields.
    fn add_schema(&mut self, fields: &mut Fields<'_>) -> Option<Result<(), String>> {
        let id = fields.u16()?;
        let (name, encoding) = (fields.string()?, fields.string()?);
        let length = fields.u32()?;
        let new = Schema { name, encoding, data: fields.bytes(length.into())?.to_vec() };
        let schema = self.schemas.entry(id).or_insert_with(|| new.clone());
        Some(if *schema == new {
            Ok(())
        } else {
            Err(format!("schema {id} is defined twice, by {} and {}", schema.name, new.name))
        })
    }

    /// `None` for ill-formed fields.
    fn add_channel(&mut self, fields: &mut Fields<'_>) -> Option<Result<(), String>> {
        let (id, schema_id) = (fields.u16()?, fields.u16()?);
        let (name, encoding) = (fields.string()?, fields.string()?);
        let metadata = fields.string_map()?;
        let schema = self.schemas.get(&schema_id);
        if schema.is_none() && schema_id != 0 {
            return Some(Err(format!("{name}: its schema {schema_id} is missing")));
        }
        let new = topic(&name, &encoding, schema, &metadata);
        let topic = self.topics.entry(id).or_insert_with(|| Arc::new(new.clone()));
        Some(if **topic == new {
            Ok(())
        } else {
            Err(format!("channel {id} is defined twice, as {} and {}", topic.name, new.name))
        })
    }
}

fn topic(
    name: &str,
    encoding: &str,
    schema: Option<&Schema>,
    metadata: &BTreeMap<String, String>,
) -> Topic {
    let entry = |key| metadata.get(key).cloned().unwrap_or_default();
    Topic {
        name: name.into(),
        type_name: schema.map_or_else(String::new, |schema| schema.name.clone()),
        message_encoding: encoding.into(),
        schema_encoding: schema.map_or_else(String::new, |schema| schema.encoding.clone()),
        schema: schema.map_or_else(Vec::new, |schema| schema.data.clone()),
        type_hash: entry(TYPE_HASH_KEY),
        qos: entry(QOS_KEY),
    }
}
