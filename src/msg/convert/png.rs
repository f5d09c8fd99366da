//! The chunks of a PNG file: whether it has its end.

/// Signature of a file.
pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Returns true if a file has its end chunk. What follows it does not count.
pub(super) fn has_end(file: &[u8]) -> bool {
    let mut rest = file.get(SIGNATURE.len()..).unwrap_or_default();
    while let Some((&[l0, l1, l2, l3, t0, t1, t2, t3], _)) = rest.split_first_chunk() {
        if [t0, t1, t2, t3] == *b"IEND" {
            return true;
        }
        // Length, type, data and checksum.
        let length = u32::from_be_bytes([l0, l1, l2, l3]) as usize;
        rest = rest.get(length.saturating_add(12)..).unwrap_or_default();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_file_has_no_end_wherever_it_is_cut() {
        let picture = image::GrayImage::from_fn(9, 7, |x, y| image::Luma([(x * y) as u8]));
        let mut file = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
        let file = file.into_inner();
        assert!(has_end(&file) && has_end(&[&file[..], b"metadata"].concat()));
        // Of the end chunk, the checksum may be missing: no picture depends on it.
        for length in 0..file.len() - 4 {
            assert!(!has_end(&file[..length]), "{length}");
        }
    }

    #[test]
    fn a_length_beyond_the_file_is_no_end() {
        assert!(!has_end(&[SIGNATURE, b"\xff\xff\xff\xffIDAT"].concat()));
    }
}
