//! Lines of two exposures whose merged line is known.

use super::*;

const SIZE_PX: (u32, u32) = (40, 30);
const FOLLOWS: FrameIndex = FrameIndex { frame_number: 1, frames_missing: 0, frames_rejected: 0 };

/// Points (column, row, intensity, flags), one connected stripe as long as columns follow one another.
fn line(points: &[(u32, f32, f32, u8)]) -> Centerline {
    let mut line = Centerline::default();
    let mut last = None;
    for &(column, row, intensity, flags) in points {
        if last.is_none_or(|last: u32| last + 1 != column) {
            line.stripe_start.push(line.len() as u32);
        }
        last = Some(column);
        line.u_px.push(column as f32);
        line.v_px.push(row);
        line.width_px.push(4.0);
        line.intensity.push(intensity);
        line.sigma_px.push(if flags & flag::SATURATED == 0 { 0.02 } else { 0.2 });
        line.flags.push(flags);
    }
    line
}

/// Dark columns 0 to 19 at 120, bright ones 20 to 29 saturated.
fn long() -> Centerline {
    let dark = (0..20).map(|column| (column, 10.0, 120.0, 0));
    let bright = (20..30).map(|column| (column, 10.5, 255.0, flag::SATURATED));
    line(&dark.chain(bright).collect::<Vec<_>>())
}

/// A quarter as long: columns 5 to 34.
fn short() -> Centerline {
    let dark = (5..20).map(|column| (column, 10.1, 30.0, 0));
    let bright = (20..35).map(|column| (column, 10.6, 100.0, 0));
    line(&dark.chain(bright).collect::<Vec<_>>())
}

/// The line of the second frame, and what became of it.
fn merge(frames: [&Centerline; 2], index: FrameIndex) -> (Centerline, ExposurePairing) {
    let mut pairs = ExposurePairs::new(StripeDirection::Horizontal);
    let [mut first, mut second] = frames.map(Clone::clone);
    assert_eq!(pairs.merge(&mut first, FrameIndex::default(), SIZE_PX), ExposurePairing::Alone);
    assert_eq!(&first, frames[0], "nothing comes before the first");
    let pairing = pairs.merge(&mut second, index, SIZE_PX);
    (second, pairing)
}

#[test]
fn saturated_and_missing_points_are_the_short_ones() {
    let (after_long, pairing) = merge([&long(), &short()], FOLLOWS);
    assert_eq!(pairing, ExposurePairing::Merged { from_before: 20 });
    let (after_short, pairing) = merge([&short(), &long()], FOLLOWS);
    assert_eq!(pairing, ExposurePairing::Merged { from_before: 15 });
    assert_eq!(after_long, after_short, "whichever came first");
    assert_eq!(after_long.len(), 35);
    assert!(after_long.v_px[..20].iter().all(|v| (v - 10.0).abs() < 1e-6), "the long one's");
    assert!(after_long.v_px[20..].iter().all(|v| (v - 10.6).abs() < 1e-6), "the short one's");
    assert!(after_long.flags.iter().all(|&flags| flags == 0));
    assert!(after_long.sigma_px.iter().all(|&sigma| sigma < 0.1));
    // 4 times 100, in the long one's grey levels.
    assert!(after_long.intensity[20..].iter().all(|level| (level - 400.0).abs() < 0.01));
    assert_eq!(after_long.stripe_start, [0], "both stripes touch");
}

#[test]
fn a_frame_is_merged_with_its_own_neighbour_not_with_a_merged_line() {
    let mut pairs = ExposurePairs::new(StripeDirection::Horizontal);
    for frame in [long(), short(), long(), short()] {
        let mut own = frame;
        pairs.merge(&mut own, FOLLOWS, SIZE_PX);
        assert!(own.len() == 35 || own == long());
    }
}

#[test]
fn without_a_direct_neighbour_a_frame_stays_alone() {
    for index in
        [FrameIndex { frames_missing: 1, ..FOLLOWS }, FrameIndex { frames_rejected: 1, ..FOLLOWS }]
    {
        assert_eq!(merge([&long(), &short()], index), (short(), ExposurePairing::Alone));
    }
    let mut pairs = ExposurePairs::new(StripeDirection::Horizontal);
    pairs.merge(&mut long(), FOLLOWS, SIZE_PX);
    assert_eq!(
        pairs.merge(&mut short(), FOLLOWS, (41, 30)),
        ExposurePairing::Alone,
        "another size"
    );
    pairs.restart();
    assert_eq!(
        pairs.merge(&mut long(), FOLLOWS, (41, 30)),
        ExposurePairing::Alone,
        "after a restart"
    );
}

#[test]
fn exposures_that_do_not_differ_are_not_merged() {
    let mut other = long();
    other.intensity.iter_mut().for_each(|level| *level *= 1.1);
    assert_eq!(merge([&long(), &other], FOLLOWS), (other, ExposurePairing::Alike));
    let empty = Centerline::default();
    assert_eq!(merge([&long(), &empty], FOLLOWS), (empty.clone(), ExposurePairing::Alike));
}

#[test]
fn lines_that_are_saturated_in_the_long_one_alone_tell_too() {
    let bright: Vec<_> = (20..30).map(|column| (column, 10.5, 255.0, flag::SATURATED)).collect();
    let (merged, pairing) = merge([&line(&bright), &short()], FOLLOWS);
    assert_eq!(pairing, ExposurePairing::Merged { from_before: 0 });
    // At least 255/100 as long.
    assert!((merged.intensity[20] - 255.0).abs() < 0.01 && merged.len() == 30);
    // Saturated in both: the one with fewer such points is the short one.
    let few: Vec<_> = (20..28).map(|column| (column, 10.6, 255.0, flag::SATURATED)).collect();
    let many: Vec<_> = (5..30).map(|column| (column, 10.5, 255.0, flag::SATURATED)).collect();
    let (merged, _) = merge([&line(&many), &line(&few)], FOLLOWS);
    assert_eq!((merged.v_px[14], merged.v_px[15], merged.v_px[23]), (10.5, 10.6, 10.5));
}

#[test]
fn surfaces_are_paired_in_their_order() {
    let mut both = [long(), short()];
    for (line, level) in both.iter_mut().zip([80.0, 20.0]) {
        // A second surface 12 px below, again from column 5 on.
        let num = line.len() as u32;
        line.stripe_start.push(num);
        for column in 5..25_u32 {
            line.u_px.push(column as f32);
            line.v_px.push(22.0);
            line.width_px.push(4.0);
            line.intensity.push(level);
            line.sigma_px.push(0.02);
            line.flags.push(0);
        }
    }
    let (merged, _) = merge([&both[0], &both[1]], FOLLOWS);
    assert_eq!((merged.len(), merged.stripe_start.as_slice()), (55, &[0, 35][..]));
    assert!(merged.v_px[35..].iter().all(|v| (v - 22.0).abs() < 1e-6));
}

#[test]
fn frames_after_the_first_ones_allocate_nothing() {
    let mut pairs = ExposurePairs::new(StripeDirection::Horizontal);
    let frames = [long(), short()];
    let mut line = Centerline::default();
    let mut process = |number: usize| {
        line.copy_from(&frames[number % 2]);
        pairs.merge(&mut line, FOLLOWS, SIZE_PX);
    };
    (0..6).for_each(&mut process);
    let counted = allocation_counter::measure(|| (6..20).for_each(&mut process));
    assert_eq!(counted.count_total, 0);
}
