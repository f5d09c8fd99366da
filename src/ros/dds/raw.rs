//! Undecoded bytes to and from RustDDS, and its time stamps in nanoseconds.

use std::convert::Infallible;

use rustdds::{
    RepresentationIdentifier as Encoding, Timestamp,
    bytes::Bytes,
    no_key::{Decode, DeserializerAdapter, SerializerAdapter},
};

use crate::ros::transport::Fault;

/// Length of a message's header: the encoding, and options that plain CDR does not use.
pub(super) const HEADER_BYTES: usize = 4;

/// A message with its header, or the reason why it is not delivered.
pub(super) type Received = Result<Vec<u8>, Fault>;

/// Accepts messages of any encoding, so that those other than plain CDR are reported as faults.
pub(super) struct RawReader;

impl DeserializerAdapter<Received> for RawReader {
    type Error = Infallible;
    type Decoded = Received;

    fn supported_encodings() -> &'static [Encoding] {
        &[
            Encoding::CDR_LE,
            Encoding::CDR_BE,
            Encoding::PL_CDR_BE,
            Encoding::PL_CDR_LE,
            Encoding::XML,
            Encoding::XCDR2_BE,
            Encoding::XCDR2_LE,
            Encoding::D_CDR2_BE,
            Encoding::D_CDR2_LE,
            Encoding::PL_XCDR2_BE,
            Encoding::PL_XCDR2_LE,
            Encoding::CDR2_BE,
            Encoding::CDR2_LE,
            Encoding::PL_CDR2_BE,
            Encoding::PL_CDR2_LE,
            Encoding::D_CDR_BE,
            Encoding::D_CDR_LE,
        ]
    }

    fn transform_decoded(decoded: Received) -> Received {
        decoded
    }
}

/// Copies a message from RustDDS's cache unless it exceeds the limit.
#[derive(Clone, Copy)]
pub(super) struct RawDecoder {
    pub(super) limit_bytes: usize,
}

impl Decode<'_, Received> for RawDecoder {
    type Error = Infallible;

    fn decode_bytes(self, body: &[u8], encoding: Encoding) -> Result<Received, Infallible> {
        Ok(self.decode(body, encoding))
    }
}

impl RawDecoder {
    fn decode(self, body: &[u8], encoding: Encoding) -> Received {
        let bytes = body.len() + HEADER_BYTES;
        let [first, second] = encoding.to_bytes();
        if !is_plain([first, second]) {
            return Err(foreign([first, second]));
        }
        if bytes > self.limit_bytes {
            return Err(Fault::TooLarge { bytes, limit_bytes: self.limit_bytes });
        }
        let mut data = Vec::with_capacity(bytes);
        data.extend_from_slice(&[first, second, 0, 0]);
        data.extend_from_slice(body);
        Ok(data)
    }
}

/// Returns true if a message begins like plain CDR.
pub(super) const fn is_plain(encapsulation: [u8; 2]) -> bool {
    matches!(encapsulation, [0, 0 | 1])
}

/// Returns the fault of a message in another encoding.
pub(super) fn foreign([first, second]: [u8; 2]) -> Fault {
    Fault::Foreign(format!(
        "encapsulation {first:02x} {second:02x} is not plain CDR (00 00 or 00 01)"
    ))
}

/// Sends little-endian CDR; RustDDS adds the header.
pub(super) struct RawWriter;

impl SerializerAdapter<Bytes> for RawWriter {
    type Error = Infallible;

    fn output_encoding() -> Encoding {
        Encoding::CDR_LE
    }

    fn to_bytes(body: &Bytes) -> Result<Bytes, Infallible> {
        Ok(body.clone())
    }
}

const NS_PER_S: u64 = 1_000_000_000;

/// Converts nanoseconds since the epoch; `None` before it and after 2106, which DDS cannot represent.
pub(super) fn timestamp(time_ns: i64) -> Option<Timestamp> {
    let time_ns = u64::try_from(time_ns).ok()?;
    let seconds = u32::try_from(time_ns / NS_PER_S).ok()?;
    let fraction = ((time_ns % NS_PER_S) << 32).div_ceil(NS_PER_S);
    Some(Timestamp::from_ticks((u64::from(seconds) << 32) + fraction))
}

/// Converts a DDS time stamp to nanoseconds since the epoch.
pub(super) fn time_ns(stamp: Timestamp) -> i64 {
    let ticks = stamp.to_ticks();
    // Cannot overflow: below 2^32 seconds.
    ((ticks >> 32) * NS_PER_S + (((ticks & 0xffff_ffff) * NS_PER_S) >> 32)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    const DECODER: RawDecoder = RawDecoder { limit_bytes: 8 };

    #[test]
    fn messages_keep_their_header() {
        let body = [1, 2, 3, 4];
        assert_eq!(DECODER.decode(&body, Encoding::CDR_LE), Ok(vec![0, 1, 0, 0, 1, 2, 3, 4]));
        assert_eq!(DECODER.decode(&body, Encoding::CDR_BE), Ok(vec![0, 0, 0, 0, 1, 2, 3, 4]));
        assert_eq!(DECODER.decode(&[], Encoding::CDR_LE), Ok(vec![0, 1, 0, 0]));
    }

    #[test]
    fn too_large_and_foreign_messages_are_faults() {
        let fault = DECODER.decode(&[0; 5], Encoding::CDR_LE);
        assert_eq!(fault, Err(Fault::TooLarge { bytes: 9, limit_bytes: 8 }));
        for encoding in RawReader::supported_encodings().iter().skip(2) {
            let fault = DECODER.decode(&[0; 4], *encoding).unwrap_err();
            assert!(fault.to_string().contains("is not plain CDR"), "{fault}");
        }
    }

    #[test]
    fn stamps_round_trip_to_the_nanosecond() {
        for time_ns in [0, 1, 999_999_999, 1_700_000_000_123_456_789, 4_294_967_295_999_999_999] {
            assert_eq!(timestamp(time_ns).map(super::time_ns), Some(time_ns));
        }
        assert_eq!(timestamp(-1), None);
        assert_eq!(timestamp(i64::MAX), None);
    }
}
