//! Numbers as text for people.

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

/// Formats nanoseconds since the epoch as UTC, as in `2018-07-18 08:00:00 UTC`.
pub(super) fn date(time_ns: i64) -> String {
    let time = jiff::Timestamp::from_nanosecond(time_ns.into()).unwrap_or_default();
    time.strftime("%Y-%m-%d %H:%M:%S UTC").to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NS: i64 = 1_000_000_000;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // From `date -u -d @…`.
        assert_eq!(date(1_531_900_000_980_000_000), "2018-07-18 07:46:40 UTC");
        assert_eq!(date(951_782_400 * NS), "2000-02-29 00:00:00 UTC");
        assert_eq!(date(-NS), "1969-12-31 23:59:59 UTC");
    }

    #[test]
    fn lengths_have_a_unit() {
        let lengths = [0, 1023, 1024, 1_000_000, 60_644_376, u64::MAX].map(bytes);
        assert_eq!(lengths, ["0 B", "1023 B", "1.00 KiB", "976.6 KiB", "57.8 MiB", "16384.0 PiB"]);
    }
}
