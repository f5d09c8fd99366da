//! `builtin_interfaces`: time on the wire. Internally, a stamp is an `i64` of nanoseconds.

use serde::{Deserialize, Serialize};

use super::schema::message;

const NS_PER_S: i64 = 1_000_000_000;

/// A point in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds since the epoch, rounded down.
    pub sec: i32,
    /// Nanoseconds to add, 0 to 999 999 999.
    pub nanosec: u32,
}

impl Time {
    /// Earliest time: 1901.
    pub const MIN: Self = Self { sec: i32::MIN, nanosec: 0 };
    /// Latest time: 2038.
    pub const MAX: Self = Self { sec: i32::MAX, nanosec: 999_999_999 };

    /// Converts nanoseconds since the epoch; clamps to [`MIN`](Self::MIN) and [`MAX`](Self::MAX).
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns).unwrap_or(if ns < 0 {
            (Self::MIN.sec, Self::MIN.nanosec)
        } else {
            (Self::MAX.sec, Self::MAX.nanosec)
        });
        Self { sec, nanosec }
    }

    /// Returns nanoseconds since the epoch; exact for every value, even if `nanosec` is a second or more.
    pub const fn to_ns(self) -> i64 {
        join(self.sec, self.nanosec)
    }
}

/// Returns seconds, rounded down, and remaining nanoseconds; `None` if the seconds do not fit.
fn split(ns: i64) -> Option<(i32, u32)> {
    let sec = i32::try_from(ns.div_euclid(NS_PER_S)).ok()?;
    Some((sec, ns.rem_euclid(NS_PER_S) as u32))
}

/// Cannot overflow: 2³¹ s and 2³² ns are 2.2e18 ns.
const fn join(sec: i32, nanosec: u32) -> i64 {
    sec as i64 * NS_PER_S + nanosec as i64
}

message!(
    Time,
    "builtin_interfaces/msg/Time",
    include_str!("definitions/builtin_interfaces/Time.msg"),
    "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    []
);

/// A time span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds, rounded down.
    pub sec: i32,
    /// Nanoseconds to add, 0 to 999 999 999.
    pub nanosec: u32,
}

impl Duration {
    /// Returns nanoseconds.
    pub(crate) const fn to_ns(self) -> i64 {
        join(self.sec, self.nanosec)
    }
}

message!(
    Duration,
    "builtin_interfaces/msg/Duration",
    include_str!("definitions/builtin_interfaces/Duration.msg"),
    "RIHS01_e8d009f659816f758b75334ee1a9ca5b5c0b859843261f14c7f937349599d93b",
    []
);

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn seconds_are_rounded_down() {
        assert_eq!(Time::from_ns(1_500_000_000), Time { sec: 1, nanosec: 500_000_000 });
        assert_eq!(Time::from_ns(-1), Time { sec: -1, nanosec: 999_999_999 });
        assert_eq!(Time { sec: -1, nanosec: 999_999_999 }.to_ns(), -1);
    }

    #[test]
    fn times_out_of_range_are_clamped() {
        assert_eq!(Time::from_ns(i64::MIN), Time::MIN);
        assert_eq!(Time::from_ns(i64::MAX), Time::MAX);
        assert_eq!(Time::from_ns(Time::MAX.to_ns() + 1), Time::MAX);
        assert_eq!(Time::from_ns(Time::MIN.to_ns() - 1), Time::MIN);
    }

    proptest! {
        #[test]
        fn every_wire_time_round_trips(sec: i32, nanosec in 0_u32..1_000_000_000) {
            let time = Time { sec, nanosec };
            prop_assert_eq!(Time::from_ns(time.to_ns()), time);
        }

        #[test]
        fn denormal_times_are_read_as_the_sum(sec: i32, nanosec: u32) {
            let sum = i128::from(sec) * 1_000_000_000 + i128::from(nanosec);
            prop_assert_eq!(i128::from(Time { sec, nanosec }.to_ns()), sum);
        }
    }
}
