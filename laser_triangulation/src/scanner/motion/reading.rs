//! A sample of an axis: its position and encoder counts.

use std::f64::consts::TAU;

use super::track::Measured;
use crate::scanner::axis::{AxisTravel, RawPosition};

/// A measured position of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Position before the scale of the calibrated axis.
    pub position: RawPosition,
    /// The same position after the scale.
    pub travel: AxisTravel,
    /// Encoder counts; 0 without an encoder.
    pub counts: i64,
}

impl Measured for Reading {
    fn between(&self, later: &Self, share: f64) -> Self {
        let position = lerp(self.position.0, later.position.0, share);
        let travel = lerp(self.travel.value(), later.travel.value(), share);
        // In integers: large counts lose their last digits in a float.
        let counted = (i128::from(later.counts) - i128::from(self.counts)) as f64 * share;
        let counts = i128::from(self.counts).saturating_add(counted.round() as i128);
        let counts = i64::try_from(counts).unwrap_or(if counts < 0 { i64::MIN } else { i64::MAX });
        Self { position: RawPosition(position), travel: self.travel.with_value(travel), counts }
    }

    fn distance(&self, other: &Self) -> f64 {
        (self.travel.value() - other.travel.value()).abs()
    }
}

fn lerp(from: f64, to: f64, share: f64) -> f64 {
    from + (to - from) * share
}

/// The angle nearest to `last_rad` that differs from `angle_rad` by whole turns: a joint that wraps after each turn goes on
/// along the scan.
pub fn unrolled(angle_rad: f64, last_rad: Option<f64>) -> f64 {
    let turns = last_rad.map_or(0.0, |last_rad| ((last_rad - angle_rad) / TAU).round());
    if turns == 0.0 { angle_rad } else { angle_rad + turns * TAU }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reading(counts: i64) -> Reading {
        Reading { position: RawPosition(0.0), travel: AxisTravel::Metres(0.0), counts }
    }

    #[test]
    fn angles_go_on_after_each_turn() {
        let mut last_rad = None;
        let mut angles = Vec::new();
        for step in 0..12 {
            let angle_rad = unrolled(f64::from(step) % TAU, last_rad);
            last_rad = Some(angle_rad);
            angles.push(angle_rad);
        }
        assert!(
            angles.iter().zip(0..).all(|(angle, step)| (angle - f64::from(step)).abs() < 1e-12)
        );
        assert!((unrolled(6.2, Some(0.1)) - (6.2 - TAU)).abs() < 1e-12, "and back");
    }

    proptest! {
        #[test]
        fn counts_lie_between_their_neighbours(from in any::<i64>(), to in any::<i64>(), share in 0.0..1.0_f64) {
            let counts = reading(from).between(&reading(to), share).counts;
            prop_assert!((from.min(to)..=from.max(to)).contains(&counts));
        }

        #[test]
        fn counts_far_from_zero_are_exact(from in any::<i64>(), step in -1000..1000_i64) {
            let to = from.saturating_add(2 * step);
            let expected = (i128::from(from) + i128::midpoint(0, i128::from(to) - i128::from(from))) as i64;
            prop_assert!((reading(from).between(&reading(to), 0.5).counts - expected).abs() <= 1);
        }
    }
}
