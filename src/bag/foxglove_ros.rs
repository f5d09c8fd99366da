//! Foxglove's image messages in ROS 2 (`foxglove_msgs`), rewritten as those of `sensor_msgs`.
//!
//! Later versions of the types have more fields behind those that are read here.

use std::borrow::Cow;

use super::foxglove_image::Kind;
use crate::msg::{
    builtin_interfaces::Time,
    cdr,
    sensor_msgs::{CompressedImage, Image},
    std_msgs::Header,
};

/// The encoding of the messages.
pub(super) const ENCODING: &str = "cdr";

/// Returns the kind of a type; `None` for types that are not read. The name is spelled as in ROS 2.
pub(super) fn kind_of(name: &str) -> Option<Kind> {
    match name {
        "foxglove_msgs/msg/RawImage" => Some(Kind::Raw),
        "foxglove_msgs/msg/CompressedImage" => Some(Kind::Compressed),
        _ => None,
    }
}

/// Rewrites a message as CDR of the type that it becomes into `out`.
///
/// # Errors
/// The message is malformed.
pub(super) fn to_cdr(kind: Kind, message: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
    let malformed = || "a malformed message of foxglove_msgs".to_owned();
    let mut fields = Fields::of(message).ok_or_else(malformed)?;
    let encoded = match kind {
        Kind::Raw => cdr::encode(&fields.raw().ok_or_else(malformed)?, out),
        Kind::Compressed => cdr::encode(&fields.compressed().ok_or_else(malformed)?, out),
    };
    encoded.map_err(|error| error.to_string())
}

/// The fields of a message that are not read yet.
struct Fields<'a> {
    /// The content behind the header of four bytes.
    content: &'a [u8],
    at: usize,
    is_little_endian: bool,
}

impl<'a> Fields<'a> {
    fn of(message: &'a [u8]) -> Option<Self> {
        let (&[0, order @ (0 | 1), _, _], content) = message.split_first_chunk()? else {
            return None;
        };
        Some(Self { content, at: 0, is_little_endian: order == 1 })
    }

    fn raw(&mut self) -> Option<Image<'a>> {
        let header = self.header()?;
        let (width, height) = (self.number()?, self.number()?);
        let (encoding, step) = (self.text()?, self.number()?);
        let data = self.bytes()?;
        // Samples of 16 bits are little-endian whatever the message is.
        Some(Image { header, height, width, encoding, is_bigendian: 0, step, data })
    }

    fn compressed(&mut self) -> Option<CompressedImage<'a>> {
        let header = self.header()?;
        let data = self.bytes()?;
        Some(CompressedImage { header, format: self.text()?, data })
    }

    fn header(&mut self) -> Option<Header<'a>> {
        let stamp = Time { sec: self.number()?.cast_signed(), nanosec: self.number()? };
        Some(Header { stamp, frame_id: self.text()? })
    }

    fn number(&mut self) -> Option<u32> {
        self.at = self.at.next_multiple_of(4);
        let bytes = *self.content.get(self.at..)?.first_chunk()?;
        self.at += 4;
        Some(if self.is_little_endian {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        })
    }

    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.number()? as usize;
        let end = self.at.checked_add(length)?;
        let bytes = self.content.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    fn text(&mut self) -> Option<Cow<'a, str>> {
        let bytes = self.bytes()?;
        let text = std::str::from_utf8(bytes.strip_suffix(b"\0")?).ok()?;
        Some(Cow::Borrowed(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `foxglove_msgs/msg/RawImage` of 3 x 2 pixels by the rules of CDR: numbers lie at multiples of four bytes behind the
    /// header, texts end in NUL.
    const RAW: &[u8] = b"\x00\x01\x00\x00\
        \x00\xf1\x53\x65\x15\xcd\x5b\x07\
        \x04\x00\x00\x00cam\x00\
        \x03\x00\x00\x00\x02\x00\x00\x00\
        \x06\x00\x00\x00mono8\x00\0\0\
        \x03\x00\x00\x00\
        \x06\x00\x00\x00\x01\x02\x03\x04\x05\xfa";
    /// The same in big-endian order, as `foxglove_msgs/msg/CompressedImage`, with the empty `message_id` of later versions.
    const COMPRESSED: &[u8] = b"\x00\x00\x00\x00\
        \x00\x00\x00\x01\x00\x00\x00\x05\
        \x00\x00\x00\x04cam\x00\
        \x00\x00\x00\x08the file\
        \x00\x00\x00\x05jpeg\x00\0\0\0\
        \x00\x00\x00\x01\x00";

    #[test]
    fn images_keep_their_fields() {
        let mut out = vec![9; 3];
        to_cdr(Kind::Raw, RAW, &mut out).unwrap();
        let image: Image<'_> = cdr::decode(&out).unwrap();
        assert_eq!(image.header.stamp, Time { sec: 1_700_000_000, nanosec: 123_456_789 });
        assert_eq!((&*image.header.frame_id, &*image.encoding), ("cam", "mono8"));
        assert_eq!((image.width, image.height, image.step), (3, 2, 3));
        assert_eq!(image.data, [1, 2, 3, 4, 5, 250]);

        to_cdr(Kind::Compressed, COMPRESSED, &mut out).unwrap();
        let image: CompressedImage<'_> = cdr::decode(&out).unwrap();
        assert_eq!(image.header.stamp, Time { sec: 1, nanosec: 5 });
        assert_eq!((&*image.format, image.data), ("jpeg", &b"the file"[..]));
    }

    #[test]
    fn a_message_that_is_cut_off_is_refused() {
        for length in 0..RAW.len() {
            assert!(to_cdr(Kind::Raw, &RAW[..length], &mut Vec::new()).is_err(), "{length}");
        }
        assert!(to_cdr(Kind::Raw, &[0xff; 40], &mut Vec::new()).is_err());
    }
}
