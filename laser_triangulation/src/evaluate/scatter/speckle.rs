//! Rendered stripes with speckle: the scatter along the stripe, and about the known centres.

use serde::Serialize;

use super::{ScatterRatio, scatter_ratio};
use crate::{
    evaluate::{
        scene::{Course, Picture, Scene},
        trial::{BORDER_COLUMNS, by_line},
    },
    scanner::{
        channel::Offset,
        params::{ExtractionParams, StripeDirection},
        stripe::{Centerline, Extractor},
    },
    simulate::{speckle::Speckle, stripe::StripeScene},
    statistics,
};

/// Frames of each case.
const NUM_FRAMES: u32 = 6;
/// Standard deviation of the read noise, grey levels.
const READ_NOISE: f64 = 2.0;
const WIDTH: u32 = 640;

/// Speckle of a stripe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Standard deviation of the brightness over its mean, 0 to 1.
    pub contrast: f64,
    /// Size of a grain, pixels.
    pub grain_px: f64,
}

/// From none to fully developed speckle.
pub const CASES: [Case; 7] = [
    Case { contrast: 0.0, grain_px: 1.0 },
    Case { contrast: 0.1, grain_px: 1.0 },
    Case { contrast: 0.3, grain_px: 0.7 },
    Case { contrast: 0.3, grain_px: 1.0 },
    Case { contrast: 0.3, grain_px: 2.0 },
    Case { contrast: 0.6, grain_px: 1.0 },
    Case { contrast: 1.0, grain_px: 1.5 },
];

/// Scatter of a method under speckle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnderSpeckle {
    /// Of each frame, along the stripe.
    pub along: Vec<ScatterRatio>,
    /// 1.4826 times the median of |error| ÷ stated standard deviation, over all frames.
    pub about_truth: f64,
}

/// Renders a bright, unsaturated stripe with this speckle and measures it. The noise is stated to the method.
#[must_use]
pub fn run(params: &ExtractionParams, case: Case) -> UnderSpeckle {
    let stripe = StripeScene {
        width: WIDTH,
        height: 160,
        amplitude: 120.0,
        read_noise: READ_NOISE,
        seed: 11,
        ..StripeScene::default()
    };
    let Case { contrast, grain_px } = case;
    let scene =
        Scene { stripe, course: Course::Wave, speckle: Some(Speckle { contrast, grain_px }) };
    let params = ExtractionParams { read_noise: READ_NOISE, shot_gain: 0.0, ..*params };
    let direction = StripeDirection::Horizontal;
    let mut extractor = Extractor::new(params, direction);
    let (mut picture, mut line) = (Picture::default(), Centerline::default());
    let (mut along, mut errors) = (Vec::new(), Vec::new());
    let counted = BORDER_COLUMNS..WIDTH as usize - BORDER_COLUMNS;
    for number in 0..NUM_FRAMES {
        scene.render(number, &mut picture);
        extractor.extract_plane(&picture.plane(), Offset::default(), 255, &mut line);
        along.extend(scatter_ratio(&line, direction, &params));
        let points = by_line(&line, direction, WIDTH as usize);
        errors.extend(counted.clone().filter_map(|column| {
            let (position_px, sigma_px) = points[column]?;
            let error_px = position_px - scene.course.center_px(column as f64);
            Some((error_px / sigma_px).abs())
        }));
    }
    UnderSpeckle {
        along,
        about_truth: statistics::sigma_about_zero(&mut errors).unwrap_or(f64::NAN),
    }
}
