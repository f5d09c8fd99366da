//! A reader of messages, with a thread of its own.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use std::{
    collections::BTreeMap,
    mem::MaybeUninit,
    ptr::{null, null_mut},
    sync::Arc,
};

use cyclors::{
    DDS_ANY_STATE, dds_builtintopic_free_endpoint, dds_create_reader,
    dds_get_matched_publication_data, dds_get_matched_publications,
    dds_get_requested_incompatible_qos_status, dds_instance_handle_t,
    dds_requested_incompatible_qos_status_t, dds_sample_info_t, dds_takecdr,
};

use crate::{
    domain::Inner,
    entity::{Entity, Guid},
    error::Error,
    qos::{Policies, Qos},
    sample::Taken,
    topic,
    worker::Worker,
    writer::no_memory,
};

/// A received message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// CDR with its header of four bytes, or what a foreign writer sent instead. On the network, up to three bytes may be
    /// added behind it.
    pub bytes: Vec<u8>,
    /// Identity of the writer; `None` if it left before its message was taken.
    pub writer: Option<Guid>,
    /// Number of the message among those of its writer, from 1.
    pub sequence: Option<i64>,
    /// Time of sending by the sender's clock, nanoseconds since the epoch.
    pub source_time_ns: i64,
}

/// A received message or fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Received {
    /// A message.
    Message(Message),
    /// A message above the limit of the reader.
    TooLarge {
        /// Its length, bytes.
        bytes: usize,
    },
}

/// A reader. Dropping it removes it from the domain; nothing is delivered afterwards.
pub struct Reader {
    // Ends before the reader is given up.
    _worker: Worker,
    reader: Arc<Entity>,
    _topic: Entity,
    guid: Guid,
}

impl Reader {
    pub(crate) fn open(
        inner: &Arc<Inner>,
        [topic_name, type_name]: [&str; 2],
        qos: &Qos,
        limit_bytes: usize,
        mut on_received: impl FnMut(Received) + Send + 'static,
    ) -> Result<Self, Error> {
        let operation = "create a reader";
        let policies = Policies::of(qos).ok_or_else(|| no_memory(operation))?;
        let topic = topic::create(&inner.participant, topic_name, type_name)?;
        let (participant, of) = (inner.participant.handle(), topic.handle());
        // SAFETY: the policies live through the call; there is no listener.
        let created = unsafe { dds_create_reader(participant, of, policies.as_ptr(), null()) };
        let reader = Arc::new(Entity::own(operation, created)?);
        let guid = reader.guid()?;
        let mut writers = Writers::default();
        let from = Arc::clone(&reader);
        let readers = vec![Arc::clone(&reader)];
        let take_one = move || {
            let Some((taken, info)) = take(&from) else { return false };
            let bytes = taken.len();
            on_received(if bytes > limit_bytes {
                Received::TooLarge { bytes }
            } else {
                let writer = writers.of(&from, info.publication_handle);
                Received::Message(message(taken, &info, writer))
            });
            true
        };
        let worker = Worker::start(&format!("dds {topic_name}"), inner, readers, take_one)?;
        Ok(Self { _worker: worker, reader, _topic: topic, guid })
    }

    /// Returns the number of writers that this reader receives from.
    pub fn num_matched(&self) -> usize {
        // SAFETY: takes any handle, and nothing is to be filled.
        let count = unsafe { dds_get_matched_publications(self.reader.handle(), null_mut(), 0) };
        usize::try_from(count).unwrap_or(0)
    }

    /// Returns how often a writer was found that does not satisfy this reader.
    pub fn num_incompatible(&self) -> u32 {
        let mut status = dds_requested_incompatible_qos_status_t {
            total_count: 0,
            total_count_change: 0,
            last_policy_id: 0,
        };
        let handle = self.reader.handle();
        // SAFETY: takes any handle; `status` is there to be filled.
        unsafe { dds_get_requested_incompatible_qos_status(handle, &raw mut status) };
        status.total_count
    }

    /// Identity of this reader.
    pub const fn guid(&self) -> Guid {
        self.guid
    }
}

/// Takes the next message; `None` if there is none.
fn take(reader: &Entity) -> Option<(Taken, dds_sample_info_t)> {
    loop {
        let mut data = null_mut();
        let mut info = MaybeUninit::uninit();
        // SAFETY: takes any handle; there is room for one message and its metadata.
        let count = unsafe {
            dds_takecdr(reader.handle(), &raw mut data, 1, info.as_mut_ptr(), DDS_ANY_STATE)
        };
        if count < 1 {
            return None;
        }
        // SAFETY: Cyclone has filled both, and gives a reference to a message of this reader's type.
        let (taken, info) = unsafe { (Taken::new(data)?, info.assume_init()) };
        // Others only tell that a writer is gone.
        if info.valid_data {
            return Some((taken, info));
        }
    }
}

fn message(taken: Taken, info: &dds_sample_info_t, writer: Option<Guid>) -> Message {
    let (bytes, sequence) = taken.into_parts();
    Message { bytes, writer, sequence, source_time_ns: info.source_timestamp }
}

/// Most known writers; beyond it, they are asked for again.
const MAX_WRITERS: usize = 64;

/// Identities of writers, by Cyclone's handles.
#[derive(Default)]
struct Writers(BTreeMap<dds_instance_handle_t, Guid>);

impl Writers {
    fn of(&mut self, reader: &Entity, handle: dds_instance_handle_t) -> Option<Guid> {
        if let Some(guid) = self.0.get(&handle) {
            return Some(*guid);
        }
        // SAFETY: takes any handles; it returns null or a structure that is ours to free.
        let guid = unsafe {
            let data = dds_get_matched_publication_data(reader.handle(), handle);
            let guid = data.as_ref()?.key.v;
            dds_builtintopic_free_endpoint(data);
            guid
        };
        if self.0.len() >= MAX_WRITERS {
            self.0.clear();
        }
        self.0.insert(handle, guid);
        Some(guid)
    }
}
