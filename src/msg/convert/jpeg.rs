//! The frame of a JPEG file: where it ends, and whether it has Huffman tables.
//!
//! Cameras append padding, metadata or a second picture. UVC cameras leave out the Huffman tables (MJPEG): those of ITU-T
//! T.81, Annex K.3, then apply.

use std::borrow::Cow;

const START_OF_IMAGE: u8 = 0xd8;
const END_OF_IMAGE: u8 = 0xd9;
const HUFFMAN_TABLES: u8 = 0xc4;
const PROGRESSIVE: u8 = 0xc2;

/// A segment whose name tells the decoder to use the tables of Annex K.3 where the file defines none.
const MOTION_JPEG: &[u8] = b"\xff\xe0\x00\x07AVI1\0";

/// The picture in a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Whole<'a> {
    /// From its first marker to its end-of-image marker.
    pub(super) picture: Cow<'a, [u8]>,
    /// True if several scans refine it.
    pub(super) is_progressive: bool,
}

/// Returns the picture up to its end-of-image marker, marked as motion JPEG if it has no Huffman tables; `None` if it is cut
/// off. (Decoders may complete truncated images silently.)
pub(super) fn whole(data: &[u8]) -> Option<Whole<'_>> {
    let start = [0xff, START_OF_IMAGE];
    let mut rest = data.strip_prefix(&start)?;
    let (mut has_tables, mut is_progressive) = (false, false);
    loop {
        let (marker, behind) = next_marker(rest)?;
        rest = behind;
        match marker {
            END_OF_IMAGE => break,
            START_OF_IMAGE => continue,
            HUFFMAN_TABLES => has_tables = true,
            PROGRESSIVE => is_progressive = true,
            _ => {}
        }
        // Of a scan, this is the header; its data follow up to the next marker.
        let length = usize::from(u16::from_be_bytes(*rest.first_chunk()?));
        rest = rest.get(length.max(2)..)?;
    }
    let picture = data.get(..data.len() - rest.len())?;
    let picture = if has_tables {
        Cow::Borrowed(picture)
    } else {
        Cow::Owned([&start, MOTION_JPEG, picture.get(start.len()..)?].concat())
    };
    Some(Whole { picture, is_progressive })
}

/// Returns the next marker and what follows it, without those between the samples: stuffed bytes, fill bytes, restarts.
fn next_marker(data: &[u8]) -> Option<(u8, &[u8])> {
    let mut rest = data;
    loop {
        let at = rest.iter().position(|&byte| byte == 0xff)?;
        rest = rest.get(at + 1..)?;
        match rest.split_first()? {
            (0xff, _) => {}
            (0x00 | 0x01 | 0xd0..=0xd7, behind) => rest = behind,
            (&marker, behind) => return Some((marker, behind)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: &[u8] = b"\xff\xd8\xff\xe0\x00\x04ab\xff\xc4\x00\x03x\xff\xda\x00\x02\x07\xff\x00\xff\xd0\x08\xff\xff\xd9";

    fn picture(data: &[u8]) -> Option<Cow<'_, [u8]>> {
        whole(data).map(|found| found.picture)
    }

    #[test]
    fn what_follows_the_end_is_left_out() {
        for behind in [&b""[..], b"\0\0\0", b"\xff\xd9", b"\xff\xd8\xff\xd9", b"metadata"] {
            let data = [FRAME, behind].concat();
            assert_eq!(picture(&data).as_deref(), Some(FRAME), "{behind:?}");
        }
    }

    #[test]
    fn a_cut_picture_has_no_end_wherever_it_is_cut() {
        for length in 0..FRAME.len() {
            assert_eq!(whole(&FRAME[..length]), None, "{length}");
        }
        // The end of the preview inside a segment is not that of the picture.
        let preview = b"\xff\xd8\xff\xe1\x00\x0aEx\xff\xd8\xff\xd9\0\0\xff\xda\x00\x02\x07";
        assert_eq!(whole(preview), None);
    }

    #[test]
    fn a_picture_without_tables_is_marked() {
        let bare = b"\xff\xd8\xff\xdb\x00\x02\xff\xda\x00\x02\x07\xff\xd9";
        let marked = b"\xff\xd8\xff\xe0\x00\x07AVI1\0\xff\xdb\x00\x02\xff\xda\x00\x02\x07\xff\xd9";
        assert_eq!(picture(bare).as_deref(), Some(&marked[..]));
        assert!(matches!(picture(FRAME), Some(Cow::Borrowed(_))));
    }
}
