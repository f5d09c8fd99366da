//! Runs the methods on one scene: the same frames for each, and every error against the scene's own centres.

use crate::{
    scanner::{
        channel::Offset,
        params::{ExtractionParams, Method, StripeDirection},
        stripe::{Centerline, Extractor},
    },
    simulate::stripe::StripeScene,
};

use super::{
    scene::{Picture, Scene},
    statistics::{Accuracy, Deviation, Tally, columns_averaged},
};

/// Columns at either border that are excluded: a blur or a ridge detector lacks image data there.
pub const BORDER_COLUMNS: usize = 16;

/// The configuration of a trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Extraction parameters. Each scene sets its noise, each method its name.
    pub params: ExtractionParams,
    /// The methods, in order.
    pub methods: Vec<Method>,
    /// Seed of all noise.
    pub seed: u64,
    /// Frames per scene; at least 2 are needed to estimate the number of averaged columns.
    pub frames: u32,
}

/// A point of a centreline: position across the stripe and its reported standard deviation, pixels.
pub type Point = (f64, f64);

/// Sorts a centreline's points into `length` columns (rows, for a vertical stripe). Keeps the first of several points
/// in a column.
pub fn by_line(line: &Centerline, direction: StripeDirection, length: usize) -> Vec<Option<Point>> {
    let (along, across) = line.along_and_across(direction);
    let mut points = vec![None; length];
    for ((&at, &position), &sigma) in along.iter().zip(across).zip(&line.sigma_px) {
        if let Some(place @ None) = points.get_mut(at as usize) {
            *place = Some((f64::from(position), f64::from(sigma)));
        }
    }
    points
}

/// Returns the deviation of a point from the truth, if there is a point.
pub fn deviation(point: Option<Point>, truth_px: f64) -> Option<Deviation> {
    point.map(|(position_px, sigma_px)| Deviation { error_px: position_px - truth_px, sigma_px })
}

/// Renders frames of a scene and passes on, for each frame and method, the points by column: `(frame, method, points)`,
/// where `method` is the index in the plan.
pub(crate) fn centerlines(
    plan: &Plan,
    scene: &Scene,
    frames: u32,
    mut take: impl FnMut(u32, usize, &[Option<Point>]),
) {
    let StripeScene { width, read_noise, shot_gain, bit_depth, .. } = scene.stripe;
    let grey = 255.0 / f64::from(bit_depth.full_scale());
    let extractor = |&method: &Method| {
        // The camera's noise is known: `sigma` is computed from it.
        let params = ExtractionParams {
            method,
            read_noise: read_noise * grey,
            shot_gain: shot_gain * grey,
            ..plan.params
        };
        Extractor::new(params, StripeDirection::Horizontal)
    };
    let mut extractors: Vec<Extractor> = plan.methods.iter().map(extractor).collect();
    let (mut picture, mut line) = (Picture::default(), Centerline::default());
    for frame in 0..frames {
        scene.render(frame, &mut picture);
        for (method, extractor) in extractors.iter_mut().enumerate() {
            let full_scale = u32::from(bit_depth.full_scale());
            extractor.extract_plane(&picture.plane(), Offset::default(), full_scale, &mut line);
            take(frame, method, &by_line(&line, StripeDirection::Horizontal, width as usize));
        }
    }
}

/// Returns the accuracy of each method and the number of columns it averages, without the [`BORDER_COLUMNS`].
pub(crate) fn run(plan: &Plan, scene: &Scene) -> Vec<(Accuracy, f64)> {
    let mut tallies = vec![Tally::default(); plan.methods.len()];
    let mut errors: Vec<Vec<Vec<f64>>> = vec![Vec::new(); plan.methods.len()];
    let counted = BORDER_COLUMNS..(scene.stripe.width as usize).saturating_sub(BORDER_COLUMNS);
    centerlines(plan, scene, plan.frames, |_, method, points| {
        let mut row = Vec::with_capacity(counted.len());
        for column in counted.clone() {
            let found = deviation(points[column], scene.course.center_px(column as f64));
            tallies[method].add(found);
            row.push(found.map_or(f64::NAN, |found| found.error_px));
        }
        errors[method].push(row);
    });
    let averaged = errors.iter().map(|frames| columns_averaged(&differences(frames)));
    tallies.iter().map(Tally::accuracy).zip(averaged).collect()
}

/// Returns each frame's errors minus those of the previous frame: two frames of a scene share their systematic errors,
/// but not their noise. Wrong points are left out.
fn differences(frames: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let right =
        |error: f64| if error.abs() > super::statistics::WRONG_PX { f64::NAN } else { error };
    let pair = |pair: &[Vec<f64>]| {
        pair[0].iter().zip(&pair[1]).map(|(&a, &b)| right(b) - right(a)).collect()
    };
    frames.chunks_exact(2).map(pair).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::{super::scene::Course, *};

    pub(crate) fn plan(methods: &[Method], frames: u32) -> Plan {
        let params = ExtractionParams::default();
        Plan { params, methods: methods.to_vec(), seed: 1, frames }
    }

    #[test]
    fn points_are_sorted_by_their_column_or_row() {
        let line = Centerline {
            u_px: vec![2.0, 4.0, 4.0, 9.0],
            v_px: vec![7.5, 8.5, 1.5, 0.5],
            sigma_px: vec![0.1, 0.2, 0.3, 0.4],
            ..Centerline::default()
        };
        let points = by_line(&line, StripeDirection::Horizontal, 6);
        let at: Vec<_> = points.iter().map(|point| point.map(|(position, _)| position)).collect();
        assert_eq!(at, [None, None, Some(7.5), None, Some(8.5), None], "9 is no column");
        let line = Centerline { u_px: line.v_px, v_px: line.u_px, ..line };
        assert_eq!(by_line(&line, StripeDirection::Vertical, 6), points);
    }

    #[test]
    fn averaged_columns_are_estimated() {
        let stripe =
            StripeScene { width: 1532, height: 256, read_noise: 4.0, ..StripeScene::default() };
        let scene = Scene { stripe, course: Course::Wave, speckle: None };
        let blurred = plan(&[Method::ImprovedGravity], 4);
        let (accuracy, columns) = run(&blurred, &scene)[0];
        assert_eq!((accuracy.columns, accuracy.points), (6000, 6000));
        // The kernel of radius 3 has sigma 1.4: 2 √π σ = 5.0.
        assert!((columns - 5.0).abs() < 0.5, "{columns}");
        let alone =
            Plan { params: ExtractionParams { blur_radius: 0, ..blurred.params }, ..blurred };
        let (alone, columns) = run(&alone, &scene)[0];
        assert!((columns - 1.0).abs() < 0.1, "{columns}");
        assert!(alone.rms_px > 1.5 * accuracy.rms_px);
    }
}
