//! Schema and channel records, and the topics they make.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records::{Record, op};

use super::Topic;

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

    /// What a summary says.
    pub(super) fn from_summary(summary: &mcap::Summary) -> Self {
        let schemas = summary.schemas.iter().map(|(id, schema)| {
            let data = schema.data.to_vec();
            (*id, Schema { name: schema.name.clone(), encoding: schema.encoding.clone(), data })
        });
        let topics = summary.channels.iter().map(|(id, channel)| {
            let schema = channel.schema.as_ref().map(|schema| Schema {
                name: schema.name.clone(),
                encoding: schema.encoding.clone(),
                data: schema.data.to_vec(),
            });
            (
                *id,
                Arc::new(topic(
                    &channel.topic,
                    &channel.message_encoding,
                    schema.as_ref(),
                    &channel.metadata,
                )),
            )
        });
        Self { schemas: schemas.collect(), topics: topics.collect() }
    }

    /// Takes a schema or channel record; any other is passed over. The same twice is normal, something else under the
    /// same number is not: the first stays.
    pub(super) fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode != op::SCHEMA && opcode != op::CHANNEL {
            return Ok(());
        }
        match mcap::parse_record(opcode, body).map_err(|error| error.to_string())? {
            Record::Schema { header, data } => {
                let new = Schema {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                };
                let schema = self.schemas.entry(header.id).or_insert_with(|| new.clone());
                if *schema != new {
                    return Err(format!(
                        "schema {} is defined twice, by {} and {}",
                        header.id, schema.name, new.name
                    ));
                }
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                if schema.is_none() && channel.schema_id != 0 {
                    return Err(format!(
                        "{}: its schema {} is missing",
                        channel.topic, channel.schema_id
                    ));
                }
                let new =
                    topic(&channel.topic, &channel.message_encoding, schema, &channel.metadata);
                let topic = self.topics.entry(channel.id).or_insert_with(|| Arc::new(new.clone()));
                if **topic != new {
                    return Err(format!(
                        "channel {} is defined twice, as {} and {}",
                        channel.id, topic.name, new.name
                    ));
                }
            }
            _ => {}
        }
        Ok(())
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
