//! Whether an axis moves the way it should.

use crate::scanner::params::ScanDirection;

/// Watches positions of one scan.
#[derive(Clone, Copy, Debug)]
pub struct Travel {
    direction: ScanDirection,
    /// What counts as standing still, metres or radians.
    backlash: f64,
    reached: Option<Reached>,
}

#[derive(Clone, Copy, Debug)]
struct Reached {
    first: f64,
    /// 1 or -1 once it is known where the scan goes; else 0.
    sign: f64,
    furthest: f64,
}

impl Travel {
    /// A scan that goes in that direction, on an axis that may move back by `backlash`, metres or radians.
    pub const fn new(direction: ScanDirection, backlash: f64) -> Self {
        Self { direction, backlash, reached: None }
    }

    /// Another scan begins.
    pub const fn restart(&mut self) {
        self.reached = None;
    }

    /// How far `position` lies from the first one.
    pub fn distance(&self, position: f64) -> f64 {
        self.reached.map_or(0.0, |reached| (position - reached.first).abs())
    }

    /// Takes the next position. True: it lies behind one that was reached before.
    pub fn is_reversed(&mut self, position: f64) -> bool {
        let sign = match self.direction {
            ScanDirection::Forward => 1.0,
            ScanDirection::Backward => -1.0,
            ScanDirection::Auto | ScanDirection::Both => 0.0,
        };
        let start = Reached { first: position, sign, furthest: position };
        let reached = self.reached.get_or_insert(start);
        let moved = position - reached.first;
        if reached.sign == 0.0 && moved.abs() > self.backlash {
            reached.sign = moved.signum();
        }
        let ahead = (position - reached.furthest) * reached.sign;
        if ahead > 0.0 {
            reached.furthest = position;
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
    fn what_was_passed_is_behind_until_it_is_passed_again() {
        let positions = [0.0, 0.05, -0.05, 1.0, 2.0, 1.95, 1.5, 1.8, 2.5];
        let expected = [false, false, false, false, false, false, true, true, false];
        assert_eq!(reversed(ScanDirection::Auto, &positions), expected);
        assert_eq!(reversed(ScanDirection::Auto, &positions.map(|position| -position)), expected);
        assert_eq!(reversed(ScanDirection::Both, &positions), [false; 9]);
    }

    #[test]
    fn an_axis_that_runs_the_wrong_way_is_found_where_the_way_is_known() {
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
