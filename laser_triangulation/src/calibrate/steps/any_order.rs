//! Heights whose order along the stripe is unknown.

use super::{
    tests::{PICTURE, Pinhole},
    *,
};

/// Pictures of plateaus side by side, with their true heights.
fn plateaus(pictures: &[&[f64]], roll_rad: f64) -> Vec<Plateau> {
    let pinhole = Pinhole::new(roll_rad);
    let mut plateaus = Vec::new();
    for (picture, heights) in pictures.iter().enumerate() {
        let width = 2000.0 / heights.len() as f64;
        for (at, height_m) in heights.iter().enumerate() {
            let from = 300.0 + width * at as f64;
            let seed = plateaus.len() as u64;
            let seen = pinhole.plateau(*height_m, [from, from + 0.9 * width], 0.03, seed);
            plateaus.push(Plateau { picture, ..seen });
        }
    }
    plateaus
}

/// The same plateaus with the heights of each picture sorted: a set.
fn sorted(plateaus: &[Plateau]) -> Vec<Plateau> {
    let mut sorted = plateaus.to_vec();
    let key = |plateau: &Plateau| (plateau.picture, plateau.height.height_m);
    let mut heights: Vec<_> = plateaus.iter().map(key).collect();
    heights.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for (plateau, (_, height_m)) in sorted.iter_mut().zip(heights) {
        plateau.height.height_m = height_m;
    }
    sorted
}

fn request(reference: HeightReference) -> StepsRequest {
    StepsRequest { terms: None, reference, picture: PICTURE }
}

#[test]
fn the_fit_finds_the_order() {
    // Also where the tilt of the line exceeds the difference of the heights.
    let tilted: [&[f64]; 2] = [&[0.0, 0.00368, 0.0], &[0.0002, 0.00914, 0.0002]];
    let stair: [&[f64]; 1] = [&[0.009, 0.001, 0.0, 0.0045, 0.012, 0.002]];
    let one_each: [&[f64]; 5] = [&[0.0], &[0.002], &[0.005], &[0.009], &[0.012]];
    for (pictures, roll_rad) in
        [(&tilted[..], 0.0), (&tilted, 0.02), (&stair, 0.0), (&stair, 0.01), (&one_each, 0.01)]
    {
        for reference in [HeightReference::Common, HeightReference::EachPicture] {
            if reference == HeightReference::EachPicture && pictures.len() == 5 {
                continue;
            }
            let truth = plateaus(pictures, roll_rad);
            let mut found = sorted(&truth);
            let sign = assign_heights(&mut found, &request(reference), None);
            let pinhole = Pinhole::new(roll_rad);
            let rises = pinhole.see(0.0, 0.01)[1] > pinhole.see(0.0, 0.0)[1];
            assert_eq!(sign, Ok(if rises { 1 } else { -1 }), "{pictures:?} {roll_rad}");
            assert_eq!(found, truth, "{pictures:?} {roll_rad} {reference:?}");
        }
    }
}

#[test]
fn an_ambiguous_order_is_an_error() {
    // Upside down, equal steps are equal steps.
    let equal = plateaus(&[&[0.0, 0.002, 0.004, 0.006, 0.008]], 0.0);
    let common = request(HeightReference::Common);
    let mut found = sorted(&equal);
    let error = assign_heights(&mut found, &common, None).unwrap_err();
    assert_eq!(error, StepsError::AmbiguousSign);
    let falls = {
        let pinhole = Pinhole::new(0.0);
        pinhole.see(0.0, 0.01)[1] < pinhole.see(0.0, 0.0)[1]
    };
    let sign = if falls { -1 } else { 1 };
    assert_eq!(assign_heights(&mut found, &common, Some(sign)), Ok(sign));
    assert_eq!(found, equal);
    // Two heights that noise exchanges.
    let close = plateaus(&[&[0.0, 2e-8, 0.004, 0.009, 0.012]], 0.0);
    let error = assign_heights(&mut sorted(&close), &common, Some(sign)).unwrap_err();
    assert!(matches!(error, StepsError::AmbiguousHeights { .. }), "{error}");
}
