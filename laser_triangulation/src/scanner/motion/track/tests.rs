use proptest::prelude::*;

use super::*;

impl Measured for f64 {
    fn between(&self, later: &Self, share: f64) -> Self {
        self + (later - self) * share
    }

    fn distance(&self, other: &Self) -> f64 {
        (self - other).abs()
    }
}

const NONE: Limits = Limits { max_gap_ns: None, max_step: None };

fn track(limits: Limits, samples: &[(i64, f64)]) -> Track<f64> {
    let mut track = Track::new(limits, MAX_SAMPLES);
    for &(stamp_ns, value) in samples {
        track.push(stamp_ns, stamp_ns, value).unwrap();
    }
    track
}

fn found(track: &Track<f64>, time_ns: i64) -> Option<(f64, u8)> {
    track.at(time_ns, i64::MAX).map(|found| (found.value, found.doubts))
}

#[test]
fn between_two_samples_lies_a_line_and_behind_them_its_end() {
    let track = track(NONE, &[(100, 1.0), (200, 2.0), (300, 4.0)]);
    assert_eq!(found(&track, 150), Some((1.5, 0)));
    assert_eq!(found(&track, 225), Some((2.5, 0)));
    assert_eq!(track.at(200, i64::MAX).map(|found| found.is_exact), Some(true));
    assert_eq!(found(&track, 350), Some((5.0, doubt::EXTRAPOLATED)));
    assert_eq!(found(&track, 700), Some((12.0, doubt::EXTRAPOLATED)));
    assert_eq!(found(&track, 701), None, "four usual intervals later anything may have happened");
    assert_eq!(found(&track, 99), None, "before the first sample nothing is known");
    assert!(track.has_reached(300) && !track.has_reached(301));
    assert_eq!((track.age_ns(250), track.age_ns(100)), (Some(50), None));
}

#[test]
fn one_sample_gives_no_value_at_any_other_time() {
    let track = track(Limits { max_gap_ns: Some(1000), ..NONE }, &[(100, 1.0)]);
    assert_eq!(found(&track, 100), Some((1.0, 0)));
    assert_eq!(found(&track, 101), None);
}

#[test]
fn a_gap_in_time_is_stale_and_a_leap_is_a_gap() {
    let limits = Limits { max_gap_ns: None, max_step: Some(1.5) };
    let track =
        track(limits, &[(100, 0.0), (110, 0.1), (120, 0.2), (160, 0.3), (201, 0.4), (211, 2.0)]);
    assert_eq!(found(&track, 140).unwrap().1, 0, "three intervals are lost: not a gap");
    assert_eq!(found(&track, 180).unwrap().1, doubt::STALE);
    assert_eq!(found(&track, 206).unwrap().1, doubt::GAP);
    assert_eq!(found(&track, 211), Some((2.0, doubt::GAP)), "exact, and yet it leapt there");
    let chosen = Limits { max_gap_ns: Some(5), max_step: None };
    assert_eq!(
        found(&self::track(chosen, &[(100, 0.0), (110, 0.1)]), 105),
        Some((0.05, doubt::STALE))
    );
}

#[test]
fn what_was_received_too_late_is_as_if_it_had_not_come() {
    let mut track = track(NONE, &[(100, 1.0), (200, 2.0)]);
    track.push(300, 1000, 9.0).unwrap();
    let at = |until_ns| track.at(250, until_ns).map(|found| (found.value, found.doubts));
    assert_eq!(at(1000), Some((5.5, 0)));
    assert_eq!(at(999), Some((2.5, doubt::EXTRAPOLATED)));
}

#[test]
fn stragglers_are_refused_and_a_clock_set_back_begins_anew() {
    let mut track = track(NONE, &[(1000, 1.0), (1100, 2.0)]);
    assert_eq!(track.push(0, 0, 1.0), Err(Refused::NoStamp));
    assert_eq!(track.push(1100, 0, 1.0), Err(Refused::Duplicate));
    assert_eq!(track.push(1050, 0, 1.0), Err(Refused::OutOfOrder));
    assert_eq!(track.push(1040, 0, 1.0), Err(Refused::OutOfOrder));
    assert_eq!(track.push(1200, 0, 3.0), Ok(false));
    for stamp_ns in [10, 20, 30] {
        assert_eq!(track.push(stamp_ns, 0, 5.0), Err(Refused::OutOfOrder));
    }
    assert_eq!(track.push(40, 0, 5.0), Ok(true));
    assert_eq!((track.last(), found(&track, 1150)), (Some((40, 5.0)), None));
}

#[test]
fn memory_is_bounded() {
    let mut track = Track::new(NONE, 3);
    for stamp_ns in 1..=10 {
        track.push(stamp_ns * 10, 0, stamp_ns as f64).unwrap();
    }
    assert_eq!(
        (track.samples.len(), found(&track, 85), found(&track, 75)),
        (3, Some((8.5, 0)), None)
    );
}

proptest! {
    /// For any samples in any order: nothing panics, the samples kept ascend, and a value outside the range of its two
    /// neighbours is flagged.
    #[test]
    fn any_samples_in_any_order(
        stamps in prop::collection::vec(prop_oneof![any::<i64>(), -50..50_i64, Just(i64::MIN), Just(i64::MAX)], 0..60),
        times in prop::collection::vec(prop_oneof![any::<i64>(), -60..60_i64], 1..20),
        max_gap_ns in prop::option::of(1..100_i64),
    ) {
        let mut track = Track::new(Limits { max_gap_ns, max_step: None }, 16);
        for (number, &stamp_ns) in stamps.iter().enumerate() {
            let before = track.samples.len();
            if track.push(stamp_ns, 0, number as f64).is_err() {
                prop_assert_eq!(track.samples.len(), before);
            }
        }
        prop_assert!(track.samples.len() <= 16);
        prop_assert!(track.samples.iter().zip(track.samples.iter().skip(1)).all(|(a, b)| a.stamp_ns < b.stamp_ns));
        for &time_ns in &times {
            let Some(found) = track.at(time_ns, i64::MAX) else { continue };
            prop_assert!(found.value.is_finite());
            let is_extrapolated = found.doubts & doubt::EXTRAPOLATED != 0;
            prop_assert_eq!(is_extrapolated, !track.has_reached(time_ns));
            if !is_extrapolated {
                prop_assert!((0.0..stamps.len() as f64).contains(&found.value));
            }
        }
    }

    /// Later samples do not change the value found.
    #[test]
    fn once_reached_a_time_is_settled(
        stamps in prop::collection::btree_set(1..10_000_i64, 3..60), time_ns in 1..10_000_i64,
    ) {
        let samples: Vec<_> = stamps.iter().map(|&stamp_ns| (stamp_ns, (stamp_ns as f64).sqrt())).collect();
        let mut track = Track::new(NONE, MAX_SAMPLES);
        let mut settled = None;
        for (stamp_ns, value) in samples {
            track.push(stamp_ns, stamp_ns, value).unwrap();
            if track.has_reached(time_ns) {
                let found = track.at(time_ns, i64::MAX);
                prop_assert_eq!(*settled.get_or_insert(found), found);
            }
        }
    }
}
