//! Assigns heights to plateaus whose order along the stripe is unknown.

use super::{Plateau, StepsError, StepsRequest, check_number, choose, fit};

/// A fit must be this many times worse than another, in squares, to be excluded.
const CLEARLY_WORSE: f64 = 10.0;
/// Ratio of the largest to the smallest depth of the plateaus that no usual setup reaches, and one that many have.
const STRONG_PERSPECTIVE: f64 = 2.0;
const WEAK_PERSPECTIVE: f64 = 1.25;
/// Number of times that heights are sorted by the fit of the last assignment.
const MAX_ROUNDS: usize = 4;

/// Plateaus with heights, and how well they fit.
struct Assigned {
    plateaus: Vec<Plateau>,
    /// Sum of squared residuals, square metres.
    squares_m2: f64,
    /// Sum of the squares that noise and gauge explain, square metres.
    explained_m2: f64,
    /// Ratio of the largest to the smallest depth.
    perspective: f64,
    /// True if heights grow with the position across the stripe.
    rises: bool,
}

/// Exchanges the heights of the plateaus within each picture so that they rise or fall steadily across the stripe.
///
/// `height_sign` states the direction: -1 if a higher surface lies at smaller rows (columns, for a vertical stripe), 1
/// if at larger ones, `None` if the fit is to decide. Returns it.
///
/// # Errors
/// Heights that fit in no order, or in several.
pub fn assign_heights(
    plateaus: &mut [Plateau],
    request: &StepsRequest,
    height_sign: Option<i8>,
) -> Result<i8, StepsError> {
    check_number(plateaus, request.reference)?;
    let signs = height_sign.map_or_else(|| vec![-1, 1], |sign| vec![sign]);
    let found = signs.into_iter().filter_map(|sign| assigned(plateaus, request, sign));
    let mut found: Vec<_> = found.collect();
    found.sort_by(|a, b| a.squares_m2.total_cmp(&b.squares_m2));
    if let [one, other] = &found[..] {
        let is_decided = is_clearly_worse(other, one) || one.plateaus == other.plateaus;
        let by_perspective = |weak: &Assigned, strong: &Assigned| {
            weak.perspective < WEAK_PERSPECTIVE && strong.perspective > STRONG_PERSPECTIVE
        };
        if !is_decided && by_perspective(other, one) {
            found.swap(0, 1);
        } else if !is_decided && !by_perspective(one, other) {
            return Err(StepsError::AmbiguousSign);
        }
    }
    let best = found.into_iter().next().ok_or(StepsError::NoMap)?;
    check_neighbours(&best, request)?;
    plateaus.clone_from_slice(&best.plateaus);
    Ok(if best.rises { 1 } else { -1 })
}

fn is_clearly_worse(worse: &Assigned, better: &Assigned) -> bool {
    worse.squares_m2 > CLEARLY_WORSE * (better.squares_m2 + better.explained_m2)
}

/// Sorts the heights of each picture by the positions of its plateaus; `None` if they fit no map.
fn assigned(plateaus: &[Plateau], request: &StepsRequest, sign: i8) -> Option<Assigned> {
    let slope = common_slope(plateaus);
    let mut plateaus = plateaus.to_vec();
    sort(&mut plateaus, |plateau| {
        f64::from(sign) * (plateau.across_px - slope * plateau.middle_px())
    });
    let mut best = evaluated(plateaus, request)?;
    for _ in 0..MAX_ROUNDS {
        let model = choose(&best.plateaus, request)?.model;
        let mut next = best.plateaus.clone();
        let height_m = |plateau: &Plateau| {
            model.height_m([plateau.middle_px(), plateau.across_px]).unwrap_or(f64::NAN)
        };
        sort(&mut next, height_m);
        if next == best.plateaus {
            break;
        }
        let next = evaluated(next, request)?;
        if next.squares_m2 >= best.squares_m2 {
            break;
        }
        best = next;
    }
    Some(best)
}

/// Gives the heights of each picture to its plateaus in the order of a key.
fn sort(plateaus: &mut [Plateau], key: impl Fn(&Plateau) -> f64) {
    let num_pictures = plateaus.iter().map(|plateau| plateau.picture + 1).max().unwrap_or(0);
    for picture in 0..num_pictures {
        let mut of_picture: Vec<usize> =
            (0..plateaus.len()).filter(|i| plateaus[*i].picture == picture).collect();
        let mut heights: Vec<_> = of_picture.iter().map(|i| plateaus[*i].height).collect();
        heights.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
        of_picture.sort_by(|a, b| key(&plateaus[*a]).total_cmp(&key(&plateaus[*b])));
        for (at, height) in of_picture.into_iter().zip(heights) {
            plateaus[at].height = height;
        }
    }
}

/// Returns the mean slope of all lines; long lines count more.
fn common_slope(plateaus: &[Plateau]) -> f64 {
    let weight = |plateau: &Plateau| (plateau.along_px[1] - plateau.along_px[0]).powi(3);
    let sum: f64 = plateaus.iter().map(|plateau| weight(plateau) * plateau.slope).sum();
    sum / plateaus.iter().map(weight).sum::<f64>()
}

fn evaluated(plateaus: Vec<Plateau>, request: &StepsRequest) -> Option<Assigned> {
    let fit = choose(&plateaus, request)?;
    let places = fit::places(&plateaus, fit.model.term);
    let squares_m2 = fit.squares(&places)?;
    let depths = || places.iter().map(|place| fit.model.denominator(place.px));
    let perspective = depths().fold(0.0, f64::max) / depths().fold(f64::INFINITY, f64::min);
    let explained = places.iter().map(|place| {
        let plateau = &plateaus[place.plateau];
        let noise_m = fit.model.slope_m_per_px(place.px)? * plateau.sigma_px;
        Some(noise_m.powi(2) + plateau.height.sigma_m.unwrap_or(0.0).powi(2))
    });
    let explained_m2 = explained.sum::<Option<f64>>()?;
    let rises = fit.model.slope_m_per_px(places.first()?.px)? > 0.0;
    Some(Assigned { plateaus, squares_m2, explained_m2, perspective, rises })
}

/// Checks that no two neighbouring heights of a picture fit as well when exchanged.
fn check_neighbours(best: &Assigned, request: &StepsRequest) -> Result<(), StepsError> {
    let plateaus = &best.plateaus;
    let mut order: Vec<usize> = (0..plateaus.len()).collect();
    let height = |i: usize| plateaus[i].height.height_m;
    order.sort_by(|a, b| {
        plateaus[*a].picture.cmp(&plateaus[*b].picture).then(height(*a).total_cmp(&height(*b)))
    });
    for (at, one) in order.iter().enumerate() {
        // The next higher plateaus of the picture, all of one height.
        let higher = order[at + 1..].iter().filter(|other| {
            plateaus[**other].picture == plateaus[*one].picture && height(**other) > height(*one)
        });
        let next = higher.clone().next().map(|other| height(*other));
        for other in higher.filter(|other| Some(height(**other)) == next) {
            let mut exchanged = plateaus.clone();
            (exchanged[*one].height, exchanged[*other].height) =
                (plateaus[*other].height, plateaus[*one].height);
            let found = evaluated(exchanged, request);
            if found.is_some_and(|found| !is_clearly_worse(&found, best)) {
                return Err(StepsError::AmbiguousHeights {
                    lower_m: height(*one),
                    upper_m: height(*other),
                    places_px: [*one, *other].map(|i| plateaus[i].middle_px()),
                });
            }
        }
    }
    Ok(())
}
