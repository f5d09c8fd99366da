//! Foxglove's image messages in Protobuf, rewritten as those of ROS 2.

use std::borrow::Cow;

use crate::msg::{
    builtin_interfaces::Time,
    cdr,
    schema::{Message, MessageType},
    sensor_msgs::{CompressedImage, Image},
    std_msgs::Header,
};

/// The encoding of the messages.
pub(super) const ENCODING: &str = "protobuf";

/// One of Foxglove's image messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `foxglove.RawImage`.
    Raw,
    /// `foxglove.CompressedImage`.
    Compressed,
}

impl Kind {
    /// Returns the kind of a type; `None` for types that are not read.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "foxglove.RawImage" => Some(Self::Raw),
            "foxglove.CompressedImage" => Some(Self::Compressed),
            _ => None,
        }
    }

    /// The type of ROS 2 that the messages become.
    pub(super) fn becomes(self) -> &'static MessageType {
        match self {
            Self::Raw => Image::TYPE,
            Self::Compressed => CompressedImage::TYPE,
        }
    }

    /// Rewrites a message as CDR into `out`.
    ///
    /// # Errors
    /// The message is malformed.
    pub(super) fn to_cdr(self, message: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
        let malformed = || "a malformed message of Protobuf".to_owned();
        let fields = Fields::of(message).ok_or_else(malformed)?;
        let stamp = fields.time(1).ok_or_else(malformed)?;
        let header = |frame_id| Some(Header { stamp, frame_id: fields.text(frame_id)? });
        let encoded = match self {
            Self::Raw => {
                let image = || {
                    Some(Image {
                        header: header(7)?,
                        height: fields.fixed(3)?,
                        width: fields.fixed(2)?,
                        encoding: fields.text(4)?,
                        is_bigendian: 0,
                        step: fields.fixed(5)?,
                        data: fields.bytes(6)?,
                    })
                };
                cdr::encode(&image().ok_or_else(malformed)?, out)
            }
            Self::Compressed => {
                let image = || {
                    let (header, format) = (header(4)?, fields.text(3)?);
                    Some(CompressedImage { header, format, data: fields.bytes(2)? })
                };
                cdr::encode(&image().ok_or_else(malformed)?, out)
            }
        };
        encoded.map_err(|error| error.to_string())
    }
}

/// Value of a field.
#[derive(Clone, Copy)]
enum Value<'a> {
    Varint(u64),
    Fixed32(u32),
    Fixed64,
    Bytes(&'a [u8]),
}

/// Fields of a message by number; of a repeated one the last is valid, as Protobuf prescribes.
struct Fields<'a>(Vec<(u64, Value<'a>)>);

impl<'a> Fields<'a> {
    fn of(mut rest: &'a [u8]) -> Option<Self> {
        let mut fields: Vec<(u64, Value<'a>)> = Vec::new();
        while !rest.is_empty() {
            let tag = varint(&mut rest)?;
            let value = match tag & 7 {
                0 => Value::Varint(varint(&mut rest)?),
                1 => take(&mut rest, 8).map(|_| Value::Fixed64)?,
                2 => {
                    let length = usize::try_from(varint(&mut rest)?).ok()?;
                    Value::Bytes(take(&mut rest, length)?)
                }
                5 => Value::Fixed32(u32::from_le_bytes(take(&mut rest, 4)?.try_into().ok()?)),
                _ => return None,
            };
            let number = tag >> 3;
            match fields.iter_mut().find(|(known, _)| *known == number) {
                Some((_, known)) => *known = value,
                // The types that are read have eight fields; others are skipped.
                None if number <= 16 => fields.push((number, value)),
                None => {}
            }
        }
        Some(Self(fields))
    }

    fn value(&self, number: u64) -> Option<Value<'a>> {
        self.0.iter().find(|(known, _)| *known == number).map(|(_, value)| *value)
    }

    /// A number; Protobuf omits 0.
    fn fixed(&self, number: u64) -> Option<u32> {
        match self.value(number) {
            None => Some(0),
            Some(Value::Fixed32(value)) => Some(value),
            Some(_) => None,
        }
    }

    fn varint(&self, number: u64) -> Option<u64> {
        match self.value(number) {
            None => Some(0),
            Some(Value::Varint(value)) => Some(value),
            Some(_) => None,
        }
    }

    fn bytes(&self, number: u64) -> Option<&'a [u8]> {
        match self.value(number) {
            None => Some(&[]),
            Some(Value::Bytes(bytes)) => Some(bytes),
            Some(_) => None,
        }
    }

    fn text(&self, number: u64) -> Option<Cow<'a, str>> {
        std::str::from_utf8(self.bytes(number)?).ok().map(Cow::Borrowed)
    }

    fn time(&self, number: u64) -> Option<Time> {
        let fields = Self::of(self.bytes(number)?)?;
        // Negative numbers are written as large ones.
        let sec = i32::try_from(fields.varint(1)?.cast_signed()).ok()?;
        Some(Time { sec, nanosec: u32::try_from(fields.varint(2)?).ok()? })
    }
}

fn take<'a>(rest: &mut &'a [u8], num_bytes: usize) -> Option<&'a [u8]> {
    let (taken, behind) = rest.split_at_checked(num_bytes)?;
    *rest = behind;
    Some(taken)
}

fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (&byte, behind) = rest.split_first()?;
        *rest = behind;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `foxglove.RawImage` of 3 x 2 pixels, written by protoc's Python library.
    const RAW: &[u8] = b"\x0a\x0b\x08\x80\xe2\xcf\xaa\x06\x10\x95\x9a\xef:\x15\x03\x00\x00\x00\x1d\x02\x00\x00\x00\x22\x05mono8-\x03\x00\x00\x002\x06\x01\x02\x03\x04\x05\xfa:\x03cam";
    /// `foxglove.CompressedImage`, written by protoc's Python library.
    const COMPRESSED: &[u8] = b"\x0a\x02\x10\x05\x12\x08the file\x1a\x04jpeg\x22\x03cam";

    fn rewritten(kind: Kind, message: &[u8]) -> Result<Vec<u8>, String> {
        let mut out = vec![9; 3];
        kind.to_cdr(message, &mut out).map(|()| out)
    }

    #[test]
    fn images_keep_their_fields() {
        let bytes = rewritten(Kind::Raw, RAW).unwrap();
        let image: Image<'_> = cdr::decode(&bytes).unwrap();
        assert_eq!(image.header.stamp, Time { sec: 1_700_000_000, nanosec: 123_456_789 });
        assert_eq!((&*image.header.frame_id, &*image.encoding), ("cam", "mono8"));
        assert_eq!((image.width, image.height, image.step), (3, 2, 3));
        assert_eq!(image.data, [1, 2, 3, 4, 5, 250]);

        let bytes = rewritten(Kind::Compressed, COMPRESSED).unwrap();
        let image: CompressedImage<'_> = cdr::decode(&bytes).unwrap();
        assert_eq!(image.header.stamp, Time { sec: 0, nanosec: 5 });
        assert_eq!((&*image.format, image.data), ("jpeg", &b"the file"[..]));
    }

    #[test]
    fn damaged_messages_are_refused_or_have_their_defaults() {
        let (mut refused, mut empty) = (0, 0);
        for length in 0..RAW.len() {
            match rewritten(Kind::Raw, &RAW[..length]) {
                Err(_) => refused += 1,
                Ok(bytes) => {
                    let image: Image<'_> = cdr::decode(&bytes).unwrap();
                    empty += usize::from(image.data.is_empty());
                }
            }
        }
        assert!(refused > 20 && empty >= 1, "{refused} {empty}");
        assert!(rewritten(Kind::Raw, &[0xff; 12]).is_err());
        assert!(rewritten(Kind::Raw, &[0x0a, 0xff, 0xff, 0xff, 0xff, 0x0f]).is_err());
    }
}
