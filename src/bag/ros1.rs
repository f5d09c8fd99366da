//! Messages of ROS 1, rewritten as those of ROS 2.
//!
//! ROS 1 packs fields without padding, ends no text with a NUL, and numbers every header; otherwise the types that are
//! read here have the same fields in the same order.

use crate::msg::{
    schema::{Message, MessageType},
    sensor_msgs::{CameraInfo, CompressedImage, Image, JointState},
    tf2_msgs::TFMessage,
};

/// Fields of a type, one letter each: `H` header, `u` four bytes, `b` one byte, `d` number of eight bytes, `s` text,
/// `B`, `D`, `S` sequences of `b`, `d`, `s`, and `T` a sequence of transforms.
pub(super) type Fields = &'static str;

/// The encoding of the messages.
pub(super) const ENCODING: &str = "ros1";
/// Bytes before the content of a CDR message: little-endian, no options.
const CDR_HEADER: [u8; 4] = [0, 1, 0, 0];
/// One element of a `T`.
const TRANSFORM: Fields = "Hsddddddd";

/// Returns the type of ROS 2 that a type of ROS 1 becomes, and its fields; `None` for types that are not read. The name is
/// spelled as in ROS 2.
pub(super) fn type_of(name: &str) -> Option<(&'static MessageType, Fields)> {
    let known: [(&MessageType, Fields); 5] = [
        (Image::TYPE, "HuusbuB"),
        (CompressedImage::TYPE, "HsB"),
        (CameraInfo::TYPE, "HuusDdddddddddddddddddddddddddddddduuuuuub"),
        (JointState::TYPE, "HSDDD"),
        (TFMessage::TYPE, "T"),
    ];
    // The name that tf had before tf2.
    let name = if name == "tf/msg/tfMessage" { TFMessage::TYPE.name } else { name };
    known.into_iter().find(|(kind, _)| kind.name == name)
}

/// Rewrites a message as CDR into `out`.
///
/// # Errors
/// The message does not have these fields.
pub(super) fn to_cdr(message: &[u8], fields: Fields, out: &mut Vec<u8>) -> Result<(), String> {
    out.clear();
    out.extend_from_slice(&CDR_HEADER);
    let mut rewriting = Rewriting { rest: message, out };
    let is_whole = rewriting.fields(fields).is_some() && rewriting.rest.is_empty();
    is_whole
        .then_some(())
        .ok_or_else(|| "a message of ROS 1 that has not the fields of its type".into())
}

struct Rewriting<'a> {
    rest: &'a [u8],
    out: &'a mut Vec<u8>,
}

impl<'a> Rewriting<'a> {
    fn fields(&mut self, fields: Fields) -> Option<()> {
        fields.bytes().try_for_each(|field| self.field(field))
    }

    fn field(&mut self, field: u8) -> Option<()> {
        match field {
            b'H' => {
                let _sequence_number = self.take(4)?;
                self.fields("uus")
            }
            b'u' => self.copy(4, 4),
            b'b' => self.copy(1, 1),
            b'd' => self.copy(8, 8),
            b's' => {
                let length = self.length()?;
                let text = self.take(length)?;
                self.put_length(length + 1)?;
                self.out.extend_from_slice(text);
                self.out.push(0);
                Some(())
            }
            b'B' => {
                let length = self.length()?;
                self.put_length(length)?;
                self.copy(length, 1)
            }
            b'D' => self.sequence("d"),
            b'S' => self.sequence("s"),
            _ => self.sequence(TRANSFORM),
        }
    }

    fn sequence(&mut self, element: Fields) -> Option<()> {
        let length = self.length()?;
        self.put_length(length)?;
        // Every element has at least one byte, so the message ends a sequence that states a false length.
        (0..length).try_for_each(|_| self.fields(element))
    }

    fn copy(&mut self, num_bytes: usize, alignment: usize) -> Option<()> {
        let taken = self.take(num_bytes)?;
        self.align(alignment);
        self.out.extend_from_slice(taken);
        Some(())
    }

    fn take(&mut self, num_bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(num_bytes)?;
        self.rest = rest;
        Some(taken)
    }

    fn length(&mut self) -> Option<usize> {
        let (taken, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        usize::try_from(u32::from_le_bytes(*taken)).ok()
    }

    fn put_length(&mut self, length: usize) -> Option<()> {
        self.align(4);
        self.out.extend_from_slice(&u32::try_from(length).ok()?.to_le_bytes());
        Some(())
    }

    /// Pads to a multiple of `alignment`, counted from the end of the CDR header.
    fn align(&mut self, alignment: usize) {
        let content_bytes = self.out.len() - CDR_HEADER.len();
        self.out.resize(CDR_HEADER.len() + content_bytes.next_multiple_of(alignment), 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::cdr;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    fn header(frame: &str) -> Vec<u8> {
        [&77_u32.to_le_bytes()[..], &5_u32.to_le_bytes(), &6_u32.to_le_bytes(), &text(frame)]
            .concat()
    }

    fn rewritten(name: &str, message: &[u8]) -> Result<Vec<u8>, String> {
        let mut out = vec![9; 3];
        to_cdr(message, type_of(name).unwrap().1, &mut out).map(|()| out)
    }

    #[test]
    fn images_keep_their_fields() {
        for frame in ["", "a", "cam", "camera_optical_frame"] {
            let numbers =
                |numbers: &[u32]| numbers.iter().flat_map(|it| it.to_le_bytes()).collect();
            let parts: [Vec<u8>; 6] = [
                header(frame),
                numbers(&[2, 3]),
                text("mono8"),
                vec![1],
                numbers(&[3, 6]),
                vec![1, 2, 3, 4, 5, 6],
            ];
            let bytes = rewritten("sensor_msgs/msg/Image", &parts.concat()).unwrap();
            let image: Image<'_> = cdr::decode(&bytes).unwrap();
            assert_eq!(
                (image.header.stamp.to_ns(), &*image.header.frame_id),
                (5_000_000_006, frame)
            );
            assert_eq!((image.height, image.width, image.step, image.is_bigendian), (2, 3, 3, 1));
            assert_eq!((&*image.encoding, image.data), ("mono8", &[1, 2, 3, 4, 5, 6][..]));
        }
    }

    #[test]
    fn joints_and_transforms_keep_their_fields() {
        let doubles = |values: &[f64]| -> Vec<u8> {
            values.iter().flat_map(|value| value.to_le_bytes()).collect()
        };
        let sequence = |values: &[f64]| {
            [(values.len() as u32).to_le_bytes().to_vec(), doubles(values)].concat()
        };
        let names = [2_u32.to_le_bytes().to_vec(), text("x"), text("table")].concat();
        let message =
            [header("f"), names, sequence(&[1.5, -2.5]), sequence(&[]), sequence(&[4.0])].concat();
        let bytes = rewritten("sensor_msgs/msg/JointState", &message).unwrap();
        let joints: JointState<'_> = cdr::decode(&bytes).unwrap();
        assert_eq!(joints.name, ["x", "table"]);
        assert_eq!(
            (joints.position, joints.velocity, joints.effort),
            (vec![1.5, -2.5], vec![], vec![4.0])
        );

        let transform = [header("world"), text("axis"), doubles(&[1., 2., 3., 0., 0., 0., 1.])];
        let transform = transform.concat();
        let message = [&2_u32.to_le_bytes()[..], &transform, &transform].concat();
        let bytes = rewritten("tf/msg/tfMessage", &message).unwrap();
        let transforms: TFMessage<'_> = cdr::decode(&bytes).unwrap();
        assert_eq!(transforms.transforms.len(), 2);
        assert_eq!(transforms.transforms[1].child_frame_id, "axis");
        assert!((transforms.transforms[1].transform.translation.z - 3.0).abs() < 1e-15);
    }

    #[test]
    fn camera_infos_keep_their_fields() {
        let doubles = |values: std::ops::Range<u32>| -> Vec<u8> {
            values.flat_map(|value| f64::from(value).to_le_bytes()).collect()
        };
        let numbers = |numbers: &[u32]| numbers.iter().flat_map(|it| it.to_le_bytes()).collect();
        let parts: [Vec<u8>; 8] = [
            header("camera"),
            numbers(&[480, 640]),
            text("plumb_bob"),
            numbers(&[5]),
            doubles(0..5),
            doubles(10..40),
            numbers(&[2, 4, 1, 2, 3, 4]),
            vec![1],
        ];
        let bytes = rewritten("sensor_msgs/msg/CameraInfo", &parts.concat()).unwrap();
        let info: CameraInfo<'_> = cdr::decode(&bytes).unwrap();
        assert_eq!((info.height, info.width, &*info.distortion_model), (480, 640, "plumb_bob"));
        assert_eq!(info.d, [0.0, 1.0, 2.0, 3.0, 4.0]);
        let (first, last) = (info.k.first().copied(), info.p.last().copied());
        assert_eq!((first, last), (Some(10.0), Some(39.0)));
        assert_eq!((info.binning_x, info.binning_y), (2, 4));
        assert!(info.roi.do_rectify && info.roi.width == 4);
    }

    #[test]
    fn other_lengths_are_refused() {
        let whole = [header("f"), text("jpeg"), text("the file")].concat();
        assert!(rewritten("sensor_msgs/msg/CompressedImage", &whole).is_ok());
        for length in 0..whole.len() {
            assert!(rewritten("sensor_msgs/msg/CompressedImage", &whole[..length]).is_err());
        }
        assert!(
            rewritten("sensor_msgs/msg/CompressedImage", &[&whole[..], &[0]].concat()).is_err()
        );
        let endless = [header("f"), u32::MAX.to_le_bytes().to_vec()].concat();
        assert!(rewritten("sensor_msgs/msg/JointState", &endless).is_err());
        assert!(type_of("sensor_msgs/msg/Imu").is_none());
    }
}
