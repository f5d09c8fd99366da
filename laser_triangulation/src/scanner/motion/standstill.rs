//! Detects profiles that lie where the profile before them lies: a scan of such profiles is no surface.

use nalgebra::Isometry3;

use crate::scanner::params::{MotionParams, MotionSource};

/// Movement up to which two places are equal, metres and radians: rounding errors of interpolated poses.
const EQUAL: f64 = 1e-9;
/// Fewest profiles within the backlash that are noise of a standing axis and not the start of a slow scan.
const MIN_WITHIN_BACKLASH: u32 = 32;

/// Tracks the places of one scan's profiles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standstill {
    /// Movement that is noise of the axis, metres and radians.
    backlash: f64,
    seen: Option<Seen>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    first: Isometry3<f64>,
    last: Isometry3<f64>,
    num: u32,
    has_left: bool,
}

impl Standstill {
    /// Creates a scan of an axis whose positions are noisy by up to `backlash`, metres (radians).
    pub(super) const fn new(backlash: f64) -> Self {
        Self { backlash, seen: None }
    }

    /// Starts a new scan.
    pub(super) const fn restart(&mut self) {
        self.seen = None;
    }

    /// Adds the next profile's place. Returns true if it is that of the profile before, or if the whole scan has not yet left
    /// the backlash about its first place.
    pub(super) fn stands(&mut self, place: &Isometry3<f64>) -> bool {
        let start = Seen { first: *place, last: *place, num: 0, has_left: false };
        let seen = self.seen.get_or_insert(start);
        seen.num = seen.num.saturating_add(1);
        seen.has_left |= is_apart(&seen.first, place, self.backlash);
        let last = std::mem::replace(&mut seen.last, *place);
        let is_noise = !seen.has_left && seen.num >= MIN_WITHIN_BACKLASH;
        seen.num > 1 && (is_noise || !is_apart(&last, place, EQUAL))
    }
}

/// True if two poses differ by more than `limit` in position, metres, or in direction, radians.
fn is_apart(one: &Isometry3<f64>, other: &Isometry3<f64>, limit: f64) -> bool {
    let shifted = (one.translation.vector - other.translation.vector).norm();
    shifted > limit || one.rotation.angle_to(&other.rotation) > limit
}

/// The parameter that moves the profiles of a scan apart, in a clause for messages.
#[must_use]
pub const fn remedy(motion: &MotionParams) -> &'static str {
    match motion.source {
        MotionSource::None => {
            "motion.source is none: set it to constant with motion.step or motion.velocity, or to the source of positions \
             (joint_state, encoder or tf)"
        }
        MotionSource::Constant if motion.step.is_some() => {
            "motion.step or the scale of the calibrated axis is too small: state the movement between two frames"
        }
        MotionSource::Constant => {
            "motion.velocity multiplies the frames' stamps, which do not advance: set motion.step in its place, or let the \
             driver stamp its frames"
        }
        MotionSource::JointState | MotionSource::Encoder | MotionSource::Tf => {
            "the axis does not move: check that motion.source and its topic are those of the axis, and scan while it moves"
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn standing(backlash: f64, places_m: impl IntoIterator<Item = f64>) -> Vec<bool> {
        let mut standstill = Standstill::new(backlash);
        let place = |y_m: f64| Isometry3::translation(0.0, y_m, 0.0);
        places_m.into_iter().map(|y_m| standstill.stands(&place(y_m))).collect()
    }

    #[test]
    fn profiles_at_the_place_of_the_one_before_stand() {
        assert_eq!(standing(1e-5, [0.0; 4]), [false, true, true, true]);
        // The axis waits, moves, waits and moves.
        let places = [0.1, 0.1, 0.2, 0.3, 0.3, 0.4];
        assert_eq!(standing(1e-5, places), [false, true, false, false, true, false]);
    }

    #[test]
    fn noise_within_the_backlash_is_no_motion() {
        let noise = |i: u32| 1e-6 * f64::from((i * 7919) % 9);
        let stands = standing(1e-5, (0..100).map(noise));
        assert!(stands[31..].iter().all(|stands| *stands), "{stands:?}");
        let moving = standing(1e-5, (0..100).map(|i| noise(i) + 1e-4 * f64::from(i)));
        assert!(!moving.contains(&true));
    }

    #[test]
    fn slow_scans_and_scans_without_backlash_move() {
        for (backlash, step_m) in [(1e-5, 0.4e-6), (0.0, 5e-9), (1e-5, -1e-4)] {
            let stands = standing(backlash, (0..200).map(|i| step_m * f64::from(i)));
            assert!(!stands.contains(&true), "{step_m}");
        }
    }

    #[test]
    fn a_turn_about_the_origin_is_a_motion() {
        let mut standstill = Standstill::new(1e-5);
        for i in 0..50 {
            let turned = Isometry3::rotation(Vector3::x() * 1e-3 * f64::from(i));
            assert!(!standstill.stands(&turned));
        }
    }
}
