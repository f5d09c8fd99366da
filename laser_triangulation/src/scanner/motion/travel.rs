//! Reversal detection and distance of one scan.

use crate::scanner::params::ScanDirection;

/// Tracks the travel of one scan: metres, or radians on a revolute axis, after the scale of the axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    direction: ScanDirection,
    /// Backlash, metres (radians): smaller backward movements are not a reversal.
    backlash: f64,
    reached: Option<Reached>,
}

#[derive(Clone, Copy, Debug)]
struct Reached {
    first: f64,
    /// 1 or -1 once the direction of the scan is known, 0 before.
    sign: f64,
    furthest: f64,
}

impl Travel {
    /// Creates a scan in that direction. Backward movement up to `backlash`, metres (radians), is ignored.
    pub(super) const fn new(direction: ScanDirection, backlash: f64) -> Self {
        Self { direction, backlash, reached: None }
    }

    /// Starts a new scan.
    pub(super) const fn restart(&mut self) {
        self.reached = None;
    }

    /// Returns the distance from the first position, never negative.
    pub(super) fn distance(&self, along: f64) -> f64 {
        self.reached.map_or(0.0, |reached| (along - reached.first).abs())
    }

    /// Adds the next position. Returns true if it lies behind the furthest one by more than the backlash.
    pub(super) fn is_reversed(&mut self, along: f64) -> bool {
        let sign = match self.direction {
            ScanDirection::Forward => 1.0,
            ScanDirection::Backward => -1.0,
            ScanDirection::Auto | ScanDirection::Both => 0.0,
        };
        let start = Reached { first: along, sign, furthest: along };
        let reached = self.reached.get_or_insert(start);
        let moved = along - reached.first;
        if reached.sign == 0.0 && moved.abs() > self.backlash {
            reached.sign = moved.signum();
        }
        let ahead = (along - reached.furthest) * reached.sign;
        if ahead > 0.0 {
            reached.furthest = along;
        }
        self.direction != ScanDirection::Both && ahead < -self.backlash
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reversed(direction: ScanDirection, positions: &[f64]) -> Vec<bool> {
        let mut travel = Travel::new(direction, 0.1);
        positions.iter().map(|&position| travel.is_reversed(position)).collect()
    }

    #[test]
    fn a_position_is_reversed_until_the_furthest_one_is_reached_again() {
        let positions = [0.0, 0.05, -0.05, 1.0, 2.0, 1.95, 1.5, 1.8, 2.5];
        let expected = [false, false, false, false, false, false, true, true, false];
        assert_eq!(reversed(ScanDirection::Auto, &positions), expected);
        assert_eq!(reversed(ScanDirection::Auto, &positions.map(|position| -position)), expected);
        assert_eq!(reversed(ScanDirection::Both, &positions), [false; 9]);
    }

    #[test]
    fn a_wrong_direction_is_detected_only_where_a_direction_is_set() {
        let positions = [0.0, -1.0, -2.0];
        assert_eq!(reversed(ScanDirection::Forward, &positions), [false, true, true]);
        assert_eq!(reversed(ScanDirection::Backward, &positions), [false; 3]);
        assert_eq!(reversed(ScanDirection::Auto, &positions), [false; 3]);
    }

    proptest! {
        #[test]
        fn a_scan_in_one_direction_is_never_reversed(
            steps in prop::collection::vec(0.0..1.0_f64, 1..50), is_backward in any::<bool>(),
        ) {
            let sign = if is_backward { -1.0 } else { 1.0 };
            let positions: Vec<_> = steps.iter().scan(0.0, |sum, step| { *sum += sign * step; Some(*sum) }).collect();
            prop_assert!(reversed(ScanDirection::Auto, &positions).iter().all(|reversed| !reversed));
        }
    }
}
