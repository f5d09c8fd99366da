//! A writer of messages.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use std::{
    ptr::{null, null_mut},
    sync::Arc,
};

use cyclors::{
    dds_create_writer, dds_forwardcdr, dds_get_entity_sertype, dds_get_matched_subscriptions,
    dds_get_offered_incompatible_qos_status, dds_offered_incompatible_qos_status_t, ddsi_sertype,
};

use crate::{
    domain::Inner,
    entity::{Entity, Guid},
    error::{Error, check},
    qos::{Policies, Qos},
    sample, topic,
};

/// Length of the header of CDR, bytes.
const HEADER_BYTES: usize = 4;

/// A writer. Dropping it removes it from the domain; messages that readers have not acknowledged are lost.
pub struct Writer {
    writer: Entity,
    _topic: Entity,
    guid: Guid,
    max_sample_bytes: usize,
    _inner: Arc<Inner>,
}

impl Writer {
    pub(crate) fn open(
        inner: &Arc<Inner>,
        topic_name: &str,
        type_name: &str,
        qos: &Qos,
    ) -> Result<Self, Error> {
        let operation = "create a writer";
        let policies = Policies::of(qos).ok_or_else(|| no_memory(operation))?;
        let topic = topic::create(&inner.participant, topic_name, type_name)?;
        let (participant, of) = (inner.participant.handle(), topic.handle());
        // SAFETY: the policies live through the call; there is no listener.
        let created = unsafe { dds_create_writer(participant, of, policies.as_ptr(), null()) };
        let writer = Entity::own(operation, created)?;
        let guid = writer.guid()?;
        let max_sample_bytes = inner.max_sample_bytes;
        Ok(Self { writer, _topic: topic, guid, max_sample_bytes, _inner: Arc::clone(inner) })
    }

    /// Sends a message of CDR with its header of four bytes. `source_time_ns`: nanoseconds since the epoch.
    ///
    /// # Errors
    /// A message without header or above the limit; readers that are too slow for a writer that keeps all messages.
    pub fn write(&self, message: &Arc<[u8]>, source_time_ns: i64) -> Result<(), Error> {
        let (bytes, limit_bytes) = (message.len(), self.max_sample_bytes);
        if bytes < HEADER_BYTES {
            return Err(Error::NoHeader(bytes));
        }
        if bytes > limit_bytes {
            return Err(Error::TooLarge { bytes, limit_bytes });
        }
        let mut kind: *const ddsi_sertype = null();
        // SAFETY: takes any handle; `kind` is there to be filled. The writer keeps its type.
        let result = unsafe { dds_get_entity_sertype(self.writer.handle(), &raw mut kind) };
        check("find the type of a writer", result)?;
        let message = sample::to_send(kind, message, source_time_ns);
        // SAFETY: takes the message, also if it fails.
        let written = unsafe { dds_forwardcdr(self.writer.handle(), message) };
        check("send a message", written).map(drop)
    }

    /// Returns the number of readers that this writer sends to.
    pub fn num_matched(&self) -> usize {
        // SAFETY: takes any handle, and nothing is to be filled.
        let count = unsafe { dds_get_matched_subscriptions(self.writer.handle(), null_mut(), 0) };
        usize::try_from(count).unwrap_or(0)
    }

    /// Returns how often a reader was found that this writer does not satisfy.
    pub fn num_incompatible(&self) -> u32 {
        let mut status = dds_offered_incompatible_qos_status_t {
            total_count: 0,
            total_count_change: 0,
            last_policy_id: 0,
        };
        let handle = self.writer.handle();
        // SAFETY: takes any handle; `status` is there to be filled.
        unsafe { dds_get_offered_incompatible_qos_status(handle, &raw mut status) };
        status.total_count
    }

    /// Identity of this writer.
    pub const fn guid(&self) -> Guid {
        self.guid
    }
}

pub(crate) fn no_memory(operation: &'static str) -> Error {
    Error::Refused { operation, reason: "out of memory".to_owned() }
}
