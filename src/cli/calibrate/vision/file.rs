//! Calibration files, read and written.

use std::{fs, path::Path};

use anyhow::{Context, bail};
use jiff::Timestamp;

use super::args::OutputArgs;
use crate::{
    calibrate::intrinsics::CameraFit,
    cli::output,
    scanner::{
        calibration::{CameraCalibration, CameraQuality},
        camera::Distortion,
    },
};

/// Names of the lens's coefficients, in ROS's order.
pub(super) const COEFFICIENTS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// Longest calibration file, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Before the work: nothing is overwritten unasked.
///
/// # Errors
/// The file is there.
pub(super) fn refuse_existing(args: &OutputArgs) -> anyhow::Result<()> {
    for path in [Some(&args.output), args.report.as_ref()].into_iter().flatten() {
        if !args.force {
            output::refuse_existing(path)?;
        }
    }
    Ok(())
}

/// A calibration file's text.
///
/// # Errors
/// It cannot be read, or is too long to be one.
pub(super) fn read(path: &Path) -> anyhow::Result<String> {
    let told = || format!("cannot read {}", path.display());
    let length = fs::metadata(path).with_context(told)?.len();
    if length > MAX_BYTES {
        bail!("{}: {length} bytes are no calibration file", path.display());
    }
    fs::read_to_string(path).with_context(told)
}

/// Writes a calibration.
///
/// # Errors
/// It cannot be written.
pub(super) fn write(args: &OutputArgs, text: &str) -> anyhow::Result<()> {
    fs::write(&args.output, text).with_context(|| format!("cannot write {}", args.output.display()))
}

/// The lens's coefficients, in ROS's order; none for a pinhole.
pub(super) fn coefficients(distortion: &Distortion) -> Vec<f64> {
    match *distortion {
        Distortion::None => Vec::new(),
        Distortion::PlumbBob { k1, k2, p1, p2, k3 } => vec![k1, k2, p1, p2, k3],
        Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => {
            vec![k1, k2, p1, p2, k3, k4, k5, k6]
        }
    }
}

/// The file of a camera alone.
pub(super) fn of_camera(name: &str, fit: &CameraFit, views_rejected: usize) -> CameraCalibration {
    let uncertainty = &fit.uncertainty;
    CameraCalibration {
        camera_name: name.to_owned(),
        camera: fit.camera,
        quality: Some(CameraQuality {
            rms_px: fit.rms_px,
            views_used: fit.used.len() as u32,
            views_rejected: views_rejected as u32,
            parameters: uncertainty.parameters.clone(),
            // Symmetric: by columns is by rows.
            covariance: uncertainty.covariance.as_slice().to_vec(),
        }),
        calibrated_at: Some(now()),
    }
}

/// Now, UTC, whole seconds.
pub(super) fn now() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}
