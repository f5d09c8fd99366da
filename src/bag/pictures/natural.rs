//! The natural order of names: `img2` before `img10`.

use std::cmp::Ordering;

/// Compares names: runs of digits by their value, everything else byte by byte. Names that differ only in leading zeros
/// are ordered byte by byte.
pub(super) fn compare(first: &[u8], second: &[u8]) -> Ordering {
    let (mut left, mut right) = (runs(first), runs(second));
    loop {
        let order = match (left.next(), right.next()) {
            (None, None) => return first.cmp(second),
            (None, Some(_)) => Ordering::Less,
            (Some(_), None) => Ordering::Greater,
            (Some(left), Some(right)) if is_number(left) && is_number(right) => {
                let [left, right] = [left, right].map(without_zeros);
                left.len().cmp(&right.len()).then_with(|| left.cmp(right))
            }
            (Some(left), Some(right)) => left.cmp(right),
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Splits a name into runs of digits and runs of other bytes.
pub(super) fn runs(name: &[u8]) -> impl Iterator<Item = &[u8]> {
    name.chunk_by(|left, right| left.is_ascii_digit() == right.is_ascii_digit())
}

/// True for a run of digits.
pub(super) fn is_number(run: &[u8]) -> bool {
    run.first().is_some_and(u8::is_ascii_digit)
}

fn without_zeros(digits: &[u8]) -> &[u8] {
    let zeros = digits.iter().take_while(|&&digit| digit == b'0').count();
    digits.get(zeros..).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(names: &[&str]) -> Vec<String> {
        let mut names: Vec<_> = names.iter().map(|&name| name.to_owned()).collect();
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        names
    }

    #[test]
    fn numbers_are_compared_by_value() {
        assert_eq!(
            sorted(&["img10.png", "img2.png", "img1.png"]),
            ["img1.png", "img2.png", "img10.png"]
        );
        assert_eq!(sorted(&["b1", "a10", "a9b2", "a9b10"]), ["a9b2", "a9b10", "a10", "b1"]);
        let stamps = ["1697712345.9.png", "1697712345.10.png", "99.1.png"];
        assert_eq!(sorted(&stamps), ["99.1.png", "1697712345.9.png", "1697712345.10.png"]);
        let long = ["99999999999999999999999999999", "100000000000000000000000000000"];
        assert_eq!(sorted(&[long[1], long[0]]), long, "longer than any integer");
    }

    #[test]
    fn the_order_is_total() {
        assert_eq!(sorted(&["img1", "img01", "img001"]), ["img001", "img01", "img1"]);
        assert_eq!(
            sorted(&["img_1", "img", "img1", "", "0", "00"]),
            ["", "0", "00", "img", "img1", "img_1"]
        );
    }
}
