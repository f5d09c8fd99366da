//! Formats numbers for display.

/// Formats a number of bytes with three digits and a binary unit.
pub(super) fn bytes(length: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if length < 1024 {
        return format!("{length} B");
    }
    let mut value = length as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    let digits = if value < 10.0 { 2 } else { 1 };
    format!("{value:.digits$} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_a_unit() {
        let lengths = [0, 1023, 1024, 1_000_000, 60_644_376, u64::MAX].map(bytes);
        assert_eq!(lengths, ["0 B", "1023 B", "1.00 KiB", "976.6 KiB", "57.8 MiB", "16384.0 PiB"]);
    }
}
