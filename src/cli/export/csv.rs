//! CSV files: one point per line.

use std::io::Write;

use super::{ExportArgs, Written};
use crate::results::{Placing, Results, recorded_profile};

/// Writes the profiles with their uncertainties, or the points of the clouds if points are selected or moved, or if there
/// are no profiles. Counts and skips profiles that cannot be read.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write(
    file: &mut impl Write,
    args: &ExportArgs,
    results: &Results,
    placing: &Placing,
) -> anyhow::Result<Written> {
    let profiles = results.profile_topic();
    match profiles.filter(|_| args.region.is_none() && args.heights.is_none() && !args.is_leveled())
    {
        Some(topic) => write_profiles(file, results, &topic),
        None => write_points(file, results, placing),
    }
}

fn write_points(
    file: &mut impl Write,
    results: &Results,
    placing: &Placing,
) -> anyhow::Result<Written> {
    writeln!(file, "x_m,y_m,z_m,intensity")?;
    let mut num_points = 0;
    results.for_each_profile(|row| {
        for [x, y, z, intensity] in placing.points(row) {
            writeln!(file, "{x},{y},{z},{intensity}")?;
            num_points += 1;
        }
        Ok(())
    })?;
    Ok(Written { num_points, num_lost: 0 })
}

/// Writes the profiles of the scan's frames.
fn write_profiles(
    file: &mut impl Write,
    results: &Results,
    topic: &str,
) -> anyhow::Result<Written> {
    writeln!(
        file,
        "frame,stamp_ns,position,x_m,z_m,intensity,sigma_z_m,flags,calibration_sigma_z_m"
    )?;
    let mut written = Written::default();
    for message in results.messages(topic) {
        let Ok(message) = message else {
            written.num_lost += 1;
            continue;
        };
        let profile = match recorded_profile(&message) {
            Ok(profile) => profile,
            Err(error) => {
                if written.num_lost == 0 {
                    tracing::warn!("{topic}: {error}");
                }
                written.num_lost += 1;
                continue;
            }
        };
        let (frame, position) = (profile.trace.frame_number, profile.trace.position);
        if !results.has_frame(frame) {
            continue;
        }
        let stamp_ns = profile.header.stamp.to_ns();
        for (i, (x, z)) in profile.x.iter().zip(profile.z.iter()).enumerate() {
            if !(x.is_finite() && z.is_finite()) {
                continue;
            }
            // Optional arrays may be empty.
            let number = |values: &[f32]| values.get(i).copied().unwrap_or(f32::NAN);
            let flags = profile.flags.get(i).copied().unwrap_or(0);
            writeln!(
                file,
                "{frame},{stamp_ns},{position},{x},{z},{},{},{flags},{}",
                number(&profile.intensity),
                number(&profile.sigma_z),
                number(&profile.calibration_sigma_z)
            )?;
            written.num_points += 1;
        }
    }
    Ok(written)
}
