//! Attachment and metadata records. Their fields must fill the body exactly.

use super::fields::Fields;
use super::{Attachment, MetadataRecord};

/// Reads the body of an attachment record and verifies its checksum.
pub(super) fn attachment(body: &[u8]) -> Result<Attachment, String> {
    let (checked, saved) = body.split_last_chunk().ok_or("an attachment without a checksum")?;
    let saved = u32::from_le_bytes(*saved);
    if saved != 0 && saved != crc32fast::hash(checked) {
        return Err("the checksum of the attachment is wrong".into());
    }
    let mut fields = Fields::of(checked);
    let mut read = || {
        let (log_time, create_time) = (fields.u64()?, fields.u64()?);
        let (name, media_type) = (fields.string()?, fields.string()?);
        let length = fields.u64()?;
        let data = fields.bytes(length)?.to_vec();
        let (log_time_ns, create_time_ns) =
            (log_time.try_into().ok()?, create_time.try_into().ok()?);
        fields.is_empty().then_some(Attachment {
            name,
            media_type,
            log_time_ns,
            create_time_ns,
            data,
        })
    };
    read().ok_or_else(|| "a malformed attachment record".into())
}

/// Reads the body of a metadata record.
pub(super) fn metadata(body: &[u8]) -> Result<MetadataRecord, String> {
    let mut fields = Fields::of(body);
    let mut read = || {
        let record = MetadataRecord { name: fields.string()?, entries: fields.string_map()? };
        fields.is_empty().then_some(record)
    };
    read().ok_or_else(|| "a malformed metadata record".into())
}
