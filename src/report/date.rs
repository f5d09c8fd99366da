//! Formats times for display.

/// Formats nanoseconds since the epoch as UTC, as in `2018-07-18 08:00:00 UTC`.
pub(crate) fn date(time_ns: i64) -> String {
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
}
