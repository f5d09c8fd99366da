//! Entities of Cyclone, deleted when dropped.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use cyclors::{dds_delete, dds_entity_t, dds_get_guid, dds_guid_t};

use crate::error::{Error, check};

/// Identity of a participant, writer or reader, as it stands on the wire.
pub type Guid = [u8; 16];

/// An entity with its children. Deleted when dropped.
#[derive(Debug)]
pub(crate) struct Entity(dds_entity_t);

impl Entity {
    /// Takes a just created entity, or the error in its place.
    pub(crate) fn own(operation: &'static str, created: dds_entity_t) -> Result<Self, Error> {
        check(operation, created).map(Self)
    }

    pub(crate) const fn handle(&self) -> dds_entity_t {
        self.0
    }

    pub(crate) fn guid(&self) -> Result<Guid, Error> {
        let mut guid = dds_guid_t { v: [0; 16] };
        // SAFETY: `guid` lives through the call. A handle may be invalid: then it returns an error.
        check("read a GUID", unsafe { dds_get_guid(self.0, &raw mut guid) })?;
        Ok(guid.v)
    }
}

impl Drop for Entity {
    fn drop(&mut self) {
        // SAFETY: takes any handle. A parent may have deleted this entity before: then it returns an error.
        let result = unsafe { dds_delete(self.0) };
        if result < 0 && result != cyclors::DDS_RETCODE_ALREADY_DELETED {
            tracing::debug!("delete a DDS entity: {}", crate::error::text(result));
        }
    }
}
