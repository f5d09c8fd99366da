//! Compressed numbers as text that a browser unpacks without a library.
//!
//! 16-bit codes, row by row; each as its difference from the code above it modulo 2^16 (the first row as it is); all low
//! bytes, then all high bytes; zlib; base64. Neighbouring rows are similar, so most differences are small or zero.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use miniz_oxide::deflate::compress_to_vec_zlib;

/// Higher levels take much longer and save a few per cent.
const LEVEL: u8 = 6;

/// Packs planes of codes one after another, each with `columns` codes per row.
#[must_use]
pub(crate) fn pack(planes: &[&[i16]], columns: usize) -> String {
    let mut bytes = Vec::with_capacity(planes.iter().map(|plane| 2 * plane.len()).sum());
    for plane in planes {
        let residuals = || {
            let above = std::iter::repeat_n(0, columns).chain(plane.iter().copied());
            plane.iter().zip(above).map(|(code, above)| code.wrapping_sub(above).to_le_bytes())
        };
        bytes.extend(residuals().map(|[low, _]| low));
        bytes.extend(residuals().map(|[_, high]| high));
    }
    STANDARD.encode(compress_to_vec_zlib(&bytes, LEVEL))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_differences_in_low_and_high_bytes() {
        let bytes = |text: &str| {
            miniz_oxide::inflate::decompress_to_vec_zlib(&STANDARD.decode(text).unwrap()).unwrap()
        };
        // Two rows of two, and one that wraps round.
        let plane = [0x0102, -1, 0x0103, i16::MIN];
        assert_eq!(
            bytes(&pack(&[&plane, &[]], 2)),
            [2, 0xff, 1, 1, 1, 0xff, 0, 0x80],
            "0x0102, -1; then 1 and -32767"
        );
    }

    #[test]
    fn equal_rows_cost_next_to_nothing() {
        let row: Vec<i16> = (0..1000).map(|at| (at * 7919 % 65_536 - 32_768) as i16).collect();
        let plane = row.repeat(100);
        assert!(pack(&[&plane], 1000).len() < 2 * pack(&[&row], 1000).len());
    }
}
