//! Attachment and metadata records, whose parts must fill their bodies exactly.

use mcap::records::{Record, op};

use super::{Attachment, MetadataRecord};

/// Bytes of an attachment record around its name, media type and content: times, lengths, checksum.
const ATTACHMENT_BYTES: usize = 8 + 8 + 4 + 4 + 8 + 4;

/// Reads the body of an attachment record and tests its checksum.
pub(super) fn attachment(body: &[u8]) -> Result<Attachment, String> {
    // The crate cuts the checksum off without looking whether it is there.
    if body.len() < names_bytes(body).unwrap_or(usize::MAX).saturating_add(ATTACHMENT_BYTES) {
        return Err("an attachment shorter than its header".into());
    }
    let Ok(Record::Attachment { header, data, .. }) = mcap::parse_record(op::ATTACHMENT, body)
    else {
        return Err("an attachment whose checksum or lengths do not fit".into());
    };
    if header.name.len() + header.media_type.len() + data.len() + ATTACHMENT_BYTES != body.len() {
        return Err("an attachment longer than its content".into());
    }
    let time_ns = |time: u64| {
        i64::try_from(time)
            .map_err(|_beyond| format!("{}: a time beyond the year 2262", header.name))
    };
    let (log_time_ns, create_time_ns) = (time_ns(header.log_time)?, time_ns(header.create_time)?);
    let (name, media_type, data) = (header.name, header.media_type, data.into_owned());
    Ok(Attachment { name, media_type, log_time_ns, create_time_ns, data })
}

/// Length of an attachment's name and media type together.
fn names_bytes(body: &[u8]) -> Option<usize> {
    let length_at = |at: usize| Some(u32::from_le_bytes(*body.get(at..)?.first_chunk()?) as usize);
    let name_bytes = length_at(16)?;
    name_bytes.checked_add(length_at(20_usize.checked_add(name_bytes)?)?)
}

/// Reads the body of a metadata record.
pub(super) fn metadata(body: &[u8]) -> Result<MetadataRecord, String> {
    let Ok(Record::Metadata(metadata)) = mcap::parse_record(op::METADATA, body) else {
        return Err("metadata whose lengths do not fit".into());
    };
    let entries = metadata.metadata;
    let entry_bytes: usize = entries.iter().map(|(key, text)| 8 + key.len() + text.len()).sum();
    if 8 + metadata.name.len() + entry_bytes != body.len() {
        return Err("metadata longer than its content".into());
    }
    Ok(MetadataRecord { name: metadata.name, entries })
}
