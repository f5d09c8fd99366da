//! Checks whether a `camera_info` describes the camera of a calibration, and finds the region of the sensor.

use nalgebra::{Point2, Point3};
use thiserror::Error;

use crate::{
    msg::sensor_msgs::CameraInfo,
    scanner::{
        calibration::Calibration,
        camera::{Camera, DistortedPixel, Distortion, View},
    },
};

/// Maximum difference between two calibrations of one camera anywhere in the image, as a fraction of its longer side.
const LARGEST_DIFFERENCE: f64 = 0.01;
/// Number of points compared along each side of the image.
const GRID: u32 = 8;

/// The reason that a `camera_info` does not match the calibrated camera.
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum Misfit {
    /// The resolutions differ.
    #[error(
        "camera_info describes a camera of {} x {} pixels, but the calibration one of {} x {}: it is another camera, or was \
         calibrated in another mode", .info.0, .info.1, .calibrated.0, .calibrated.1
    )]
    Size {
        /// Columns and rows according to the message.
        info: (u32, u32),
        /// Columns and rows of the calibration.
        calibrated: (u32, u32),
    },
    /// The region of interest does not lie on the sensor.
    #[error(
        "the roi of camera_info, {} x {} from ({}, {}), does not lie in its {} x {} pixels", .size_px[0], .size_px[1],
        .offset_px[0], .offset_px[1], .sensor_px[0], .sensor_px[1]
    )]
    Roi {
        /// First column and row.
        offset_px: [u32; 2],
        /// Columns and rows.
        size_px: [u32; 2],
        /// Columns and rows of the sensor.
        sensor_px: [u32; 2],
    },
    /// The distortion model cannot be compared.
    #[error(
        "camera_info has distortion model {model:?} with {count} coefficients: allowed are plumb_bob (5), \
         rational_polynomial (8) and equidistant (4), and zeros after these"
    )]
    Model {
        /// Its name.
        model: String,
        /// Number of coefficients.
        count: usize,
    },
    /// The projections differ too much: it is another camera.
    #[error(
        "K and D of camera_info project points up to {difference_px:.1} px from where the calibration does, more than 1 % of \
         the image's longer side: it is another camera, or its images are rectified (image_rect), which cannot be measured"
    )]
    Camera {
        /// Largest distance in the image, pixels, rounded to a tenth.
        difference_px: f64,
    },
}

/// Result of comparing a `camera_info` with the calibrated camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// The region of the sensor that its images show.
    pub(crate) view: View,
    /// Largest distance between the projections of the same point by both cameras, pixels. Two calibrations of one
    /// camera are never equal.
    pub(crate) difference_px: f64,
}

/// True if a message states nothing: drivers without a calibration publish zeros.
pub(crate) fn is_unknown(info: &CameraInfo<'_>) -> bool {
    states_no_size(info) && !states_camera(info)
}

fn states_no_size(info: &CameraInfo<'_>) -> bool {
    (info.width, info.height) == (0, 0)
}

/// True if the message has a camera matrix; zeros mean that the driver is not calibrated.
fn states_camera(info: &CameraInfo<'_>) -> bool {
    info.k[0] != 0.0
}

/// Returns the region of the sensor that a `camera_info` describes, and the difference of its camera from the
/// calibrated one. A message without a size is of the calibrated size.
///
/// # Errors
/// The message is from a camera other than the calibrated one.
pub(crate) fn fit(calibration: &Calibration, info: &CameraInfo<'_>) -> Result<Fit, Misfit> {
    let Some(calibrated) = calibration.image_size_px() else {
        return Ok(Fit { view: view(info)?, difference_px: 0.0 });
    };
    let sized = CameraInfo { width: calibrated.0, height: calibrated.1, ..info.clone() };
    let info = if states_no_size(info) { &sized } else { info };
    let mut fit = Fit { view: view(info)?, difference_px: 0.0 };
    if (info.width, info.height) != calibrated {
        return Err(Misfit::Size { info: (info.width, info.height), calibrated });
    }
    if let (Calibration::CameraAndPlane(geometry), true) = (calibration, states_camera(info)) {
        fit.difference_px = compare(&geometry.camera, info)?;
    }
    Ok(fit)
}

/// Returns the region of the sensor that a message states.
///
/// # Errors
/// The region does not lie on the sensor.
pub(crate) fn view(info: &CameraInfo<'_>) -> Result<View, Misfit> {
    let roi = &info.roi;
    let sensor_px = [info.width, info.height];
    let offset_px = [roi.x_offset, roi.y_offset];
    // Width 0 and height 0 mean the whole sensor.
    let size_px = [0, 1].map(|axis| match [roi.width, roi.height][axis] {
        0 => sensor_px[axis].saturating_sub(offset_px[axis]),
        size => size,
    });
    let fits = |axis: usize| {
        size_px[axis] > 0
            && u64::from(offset_px[axis]) + u64::from(size_px[axis]) <= u64::from(sensor_px[axis])
    };
    if !(fits(0) && fits(1)) {
        return Err(Misfit::Roi { offset_px, size_px, sensor_px });
    }
    let binning = [info.binning_x.max(1), info.binning_y.max(1)];
    let size_px = [size_px[0] / binning[0], size_px[1] / binning[1]];
    Ok(View { offset_px, size_px, binning })
}

/// Largest distance between the projections of a point by both cameras, pixels.
fn compare(calibrated: &Camera, info: &CameraInfo<'_>) -> Result<f64, Misfit> {
    let model = if info.distortion_model.is_empty() { "plumb_bob" } else { &info.distortion_model };
    let distortion = Distortion::from_coefficients(model, &info.d)
        .map_err(|_allowed| Misfit::Model { model: model.to_owned(), count: info.d.len() })?;
    let described = Camera {
        fx_px: info.k[0],
        fy_px: info.k[4],
        cx_px: info.k[2],
        cy_px: info.k[5],
        distortion,
        // The message cannot represent a tilt.
        ..*calibrated
    };
    let (mut difference_px, mut compared) = (0.0_f64, 0);
    for place in 0..(GRID + 1) * (GRID + 1) {
        let along = |step: u32, size: u32| {
            f64::from(step) / f64::from(GRID) * f64::from(size.saturating_sub(1))
        };
        let pixel = Point2::new(
            along(place % (GRID + 1), calibrated.width_px),
            along(place / (GRID + 1), calibrated.height_px),
        );
        let Some(ray) = calibrated.ray(DistortedPixel(pixel)) else { continue };
        let seen = described.project(Point3::from(ray));
        difference_px =
            difference_px.max(seen.map_or(f64::INFINITY, |seen| (seen.0 - pixel).norm()));
        compared += 1;
    }
    let longer_px = f64::from(calibrated.width_px.max(calibrated.height_px));
    if compared == 0 || difference_px.is_nan() || difference_px > LARGEST_DIFFERENCE * longer_px {
        let difference_px = (10.0 * difference_px).ceil() / 10.0;
        return Err(Misfit::Camera { difference_px });
    }
    Ok(difference_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::sensor_msgs::RegionOfInterest;

    const CALIBRATION: &str = "
type: camera_and_plane
frame_id: laser
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [625.0, 0, 317.5, 0, 623.5, 242.25, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.12, -0.2, 0, -0.003, 0]}
laser_plane: {normal: [0.0, -0.866, 0.5], distance_m: 0.15}
";

    fn calibration() -> Calibration {
        Calibration::from_yaml(CALIBRATION).unwrap()
    }

    fn info() -> CameraInfo<'static> {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: "plumb_bob".into(),
            d: vec![0.12, -0.2, 0.0, -0.003, 0.0],
            k: [625.0, 0.0, 317.5, 0.0, 623.5, 242.25, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    #[test]
    fn the_calibrated_camera_fits_with_roi_and_binning() {
        let whole = Fit { view: View::whole([640, 480]), difference_px: 0.0 };
        let near = |fit: Fit, other: Fit| {
            fit.view == other.view && (fit.difference_px - other.difference_px).abs() < 1e-6
        };
        assert!(near(fit(&calibration(), &info()).unwrap(), whole));
        let roi = RegionOfInterest {
            x_offset: 100,
            y_offset: 40,
            width: 200,
            height: 100,
            do_rectify: false,
        };
        let part = CameraInfo { roi, binning_x: 2, binning_y: 4, ..info() };
        let expected = View { offset_px: [100, 40], size_px: [100, 25], binning: [2, 4] };
        assert_eq!(fit(&calibration(), &part).unwrap().view, expected);
        // A driver without a calibration of its own.
        let unknown = CameraInfo { k: [0.0; 9], d: vec![], ..info() };
        assert!(near(fit(&calibration(), &unknown).unwrap(), whole));
        // A driver that states its camera, but no size.
        let sizeless = CameraInfo { width: 0, height: 0, ..info() };
        assert!(near(fit(&calibration(), &sizeless).unwrap(), whole));
        // An older calibration of the same camera.
        let mut older = info();
        older.k[0] = 627.0;
        let difference_px = fit(&calibration(), &older).unwrap().difference_px;
        assert!((0.9..1.3).contains(&difference_px), "{difference_px}");
    }

    #[test]
    fn another_camera_is_reported_with_the_difference() {
        let roi = |x_offset, width| RegionOfInterest { x_offset, width, ..Default::default() };
        let mut longer = info();
        longer.k[0] = 640.0;
        for (info, word) in [
            (CameraInfo { width: 1280, ..info() }, "1280 x 480"),
            (CameraInfo { roi: roi(600, 41), ..info() }, "roi"),
            (CameraInfo { roi: roi(u32::MAX, u32::MAX), ..info() }, "roi"),
            (CameraInfo { distortion_model: "fov".into(), ..info() }, "\"fov\""),
            (CameraInfo { distortion_model: "equidistant".into(), ..info() }, "px from where"),
            (CameraInfo { d: vec![0.1], ..info() }, "1 coefficients"),
            (CameraInfo { d: vec![0.0; 5], ..info() }, "px from where"),
            (longer, "px from where"),
        ] {
            let misfit = fit(&calibration(), &info).unwrap_err().to_string();
            assert!(misfit.contains(word), "{word}: {misfit}");
        }
    }
}
