use nalgebra::{Unit, Vector3};
use proptest::prelude::*;

use super::*;
use crate::scanner::{
    calibration::{
        CameraAndPlane, CameraQuality, PlaneQuality, Projective, StepsQuality, VerticalIncidence,
    },
    camera::{Camera, Distortion, View},
    laser_plane::LaserPlane,
};

const SIZE_PX: (u32, u32) = (1280, 1024);

/// A diagonal covariance.
fn diagonal(sigmas: &[f64]) -> Vec<f64> {
    let num = sigmas.len();
    let entry = |at: usize| if at.is_multiple_of(num + 1) { sigmas[at / num].powi(2) } else { 0.0 };
    (0..num * num).map(entry).collect()
}

fn vertical_incidence() -> Calibration {
    let covariance = diagonal(&[2e-5, 1e-4, 1e-3, 0.5]);
    Calibration::VerticalIncidence(VerticalIncidence {
        frame_id: "laser_plane".into(),
        image_distance_m: 0.026,
        object_distance_m: 0.3,
        beta_rad: 0.52,
        pixel_pitch_m: 4.8e-6,
        base_row_px: 512.0,
        center_column_px: 640.0,
        height_sign: -1,
        quality: Some(StepsQuality {
            rms_m: 0.0,
            heights_used: 5,
            covariance,
            volume: None,
            bow: None,
        }),
    })
}

/// Height 0 is exact; the laser plane's horizon is in the picture.
fn projective() -> Calibration {
    let mut sigmas = [0.0; 9];
    (sigmas[4], sigmas[7]) = (5e-8, 2e-6);
    let covariance = diagonal(&sigmas);
    let homography = [5e-5, 0.0, -0.03, 0.0, -5e-5, 0.04, 0.0, -1.2e-3, 1.0];
    Calibration::Projective(Box::new(Projective {
        frame_id: "laser_plane".into(),
        width_px: SIZE_PX.0,
        height_px: SIZE_PX.1,
        homography,
        quality: Some(StepsQuality {
            rms_m: 0.0,
            heights_used: 5,
            covariance,
            volume: None,
            bow: None,
        }),
        calibrated_at: None,
    }))
}

fn camera_and_plane(distortion: Distortion) -> Calibration {
    let parameters = ["fx", "fy", "cx", "cy", "k1", "k2", "p1"];
    let num = parameters.len();
    let response = (0..3 * num).map(|at| 1e-6 * ((at * at % 7) as f64 - 3.0)).collect();
    Calibration::CameraAndPlane(Box::new(CameraAndPlane {
        frame_id: "laser_plane".into(),
        camera_name: "camera".into(),
        camera: Camera {
            width_px: SIZE_PX.0,
            height_px: SIZE_PX.1,
            fx_px: 1600.0,
            fy_px: 1605.0,
            cx_px: 651.0,
            cy_px: 502.0,
            distortion,
            tilt_rad: [0.0; 2],
        },
        camera_quality: Some(CameraQuality {
            rms_px: 0.1,
            views_used: 20,
            views_rejected: 0,
            parameters: parameters.map(str::to_owned).to_vec(),
            covariance: diagonal(&[1.0, 1.1, 0.8, 0.9, 2e-3, 1e-2, 1e-4]),
            volume: None,
        }),
        plane: LaserPlane {
            normal: Unit::new_normalize(Vector3::new(0.1, -0.8, 0.6)),
            distance_m: 0.24,
        },
        plane_quality: Some(PlaneQuality {
            rms_m: 0.0,
            boards_used: 20,
            covariance: Some([1e-8, 2e-9, 0.0, 2e-9, 4e-8, 1e-9, 0.0, 1e-9, 1e-8]),
            camera_response: Some(response),
            volume: None,
        }),
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    }))
}

const MILD: Distortion =
    Distortion::PlumbBob { k1: -0.11, k2: 0.08, p1: 0.0007, p2: -0.0005, k3: 0.0 };
/// Folds back within the image.
const FOLDING: Distortion = Distortion::PlumbBob { k1: -0.9, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };

fn prepared(calibration: &Calibration, direction: StripeDirection) -> HeightSigma {
    let mut sigma = HeightSigma::new(calibration).unwrap();
    sigma.prepare(direction, SIZE_PX);
    sigma
}

/// Returns what a profile states at a searched line and a place across it.
fn stated(sigma: &HeightSigma, direction: StripeDirection, line: usize, across_px: f32) -> f64 {
    let mut values = [across_px];
    sigma.replace(&Lines { direction, first: line, count: 1 }, &mut values);
    values[0].into()
}

fn share_of_entries(sigma: &HeightSigma) -> f64 {
    let cells = &sigma.table.as_ref().unwrap().cells;
    let entries = cells.iter().filter(|cell| cell[0][0].is_finite());
    entries.count() as f64 / cells.len() as f64
}

proptest! {
    /// The table interpolates to a hundredth of the largest value beside a place.
    #[test]
    fn the_table_gives_what_is_computed(
        along in 0.0..1.0_f64, across in 0.0..1.0_f64,
        direction in prop::sample::select(vec![StripeDirection::Horizontal, StripeDirection::Vertical]),
    ) {
        let extent = match direction {
            StripeDirection::Horizontal => [1279.0, 1023.0],
            StripeDirection::Vertical => [1023.0, 1279.0],
        };
        let (line, across_px) = ((along * extent[0]) as usize, (across * extent[1]) as f32);
        let place_px = [line as f64, f64::from(across_px)];
        for calibration in [
            vertical_incidence(), projective(), camera_and_plane(MILD), camera_and_plane(Distortion::None),
            camera_and_plane(FOLDING),
        ] {
            let sigma = prepared(&calibration, direction);
            let nominal = calibration.points_m(direction, std::iter::once(place_px)).next().unwrap()[1];
            if nominal.is_nan() {
                continue;
            }
            let beside = |[a, b]: [f64; 2]| {
                let steps = [a * extent[0], b * extent[1]].map(|px| px / CELLS as f64);
                sigma.computed(direction, [place_px[0] + steps[0], place_px[1] + steps[1]])
            };
            let around = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
            let largest = around.map(beside).into_iter().fold(0.0, f64::max);
            let error = stated(&sigma, direction, line, across_px) - sigma.computed(direction, place_px);
            prop_assert!(
                error.is_nan() || error.abs() <= 0.0101 * largest + 1e-12,
                "{error} of {largest} at {place_px:?}: {calibration:?}"
            );
        }
    }
}

#[test]
fn nearly_every_place_has_an_entry() {
    for (calibration, least) in [
        (vertical_incidence(), 1.0),
        (camera_and_plane(MILD), 1.0),
        (camera_and_plane(Distortion::None), 1.0),
        // The horizon is at 0.81 of the rows; the cells before it are left out, too.
        (projective(), 0.65),
    ] {
        for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
            let share = share_of_entries(&prepared(&calibration, direction));
            assert!(share >= least, "{share} {calibration:?}");
        }
    }
}

/// By hand: z = -5e-5 (v - 800) / (1 - 1.2e-3 v), and the derivatives by the two uncertain entries.
#[test]
fn two_uncertain_entries_of_a_homography_add_in_quadrature() {
    let sigma = prepared(&projective(), StripeDirection::Horizontal);
    for v in [100.0_f64, 333.3, 500.0] {
        let w = 1.0 - 1.2e-3 * v;
        let z_m = (0.04 - 5e-5 * v) / w;
        let by_hand = (5e-8 * v / w).hypot(2e-6 * v * z_m / w);
        let found = stated(&sigma, StripeDirection::Horizontal, 400, v as f32);
        assert!((found / by_hand - 1.0).abs() < 0.01, "{found} {by_hand}");
    }
}

#[test]
fn a_part_of_the_sensor_has_the_uncertainty_of_the_sensor() {
    let view = View { offset_px: [100, 60], size_px: [500, 300], binning: [2, 3] };
    for calibration in [projective(), camera_and_plane(MILD)] {
        let on_sensor = HeightSigma::new(&calibration).unwrap();
        let in_part = HeightSigma::new(&calibration.seen_through(&view)).unwrap();
        for (column, row) in [(0.0, 0.0), (250.5, 100.0), (499.0, 180.0)] {
            let at = view.on_sensor(nalgebra::Point2::new(column, row));
            let wanted = on_sensor.computed(StripeDirection::Horizontal, [at.x, at.y]);
            let found = in_part.computed(StripeDirection::Horizontal, [column, row]);
            // The principal axes of correlated entries are others, which shows in the second order.
            assert!((found / wanted - 1.0).abs() < 0.01, "{found} {wanted}");
        }
    }
}

/// All lines of an image at once, which run through every cell, as each alone.
#[test]
fn a_whole_line_is_as_its_points() {
    let direction = StripeDirection::Horizontal;
    let sigma = prepared(&camera_and_plane(MILD), direction);
    let places: Vec<_> = (0..1280_u16).map(|line| 300.25 + 0.3 * f32::from(line)).collect();
    let mut values = places.clone();
    values[7] = f32::NAN;
    sigma.replace(&Lines { direction, first: 0, count: values.len() }, &mut values);
    assert!(values[7].is_nan());
    for (line, (place, value)) in places.iter().zip(&values).enumerate().filter(|(at, _)| *at != 7)
    {
        let alone = stated(&sigma, direction, line, *place);
        assert!((f64::from(*value) / alone - 1.0).abs() < 1e-4, "{line}: {value} {alone}");
    }
    // Without a table, and for another direction, every point is computed.
    let plain = HeightSigma::new(&camera_and_plane(MILD)).unwrap();
    let computed = stated(&plain, direction, 640, 500.0);
    assert!((computed / stated(&sigma, direction, 640, 500.0) - 1.0).abs() < 0.01, "{computed}");
}

#[test]
fn files_without_uncertainty_state_none() {
    let Calibration::VerticalIncidence(mut geometry) = vertical_incidence() else { panic!() };
    geometry.quality = None;
    assert!(HeightSigma::new(&Calibration::VerticalIncidence(geometry)).is_none());
}
