//! The plateaus of the gauge in all pictures.

use std::path::PathBuf;

use anyhow::anyhow;

use super::args::{Source, StepsArgs};
use crate::{
    calibrate::{
        GaugeHeight, GaugePicture, GaugePlateau, GaugeStripe, PlateauError, find_plateaus,
    },
    cli::{Usage, calibrate::line, progress::progress_bar, settings::Settings},
    scanner::params::StripeDirection,
};

/// The plateaus of all pictures.
pub(super) struct Gauge {
    /// Picture of each plateau.
    pub(super) sources: Vec<PathBuf>,
    /// The plateaus.
    pub(super) plateaus: Vec<GaugePlateau>,
    /// Size and direction of all pictures.
    pub(super) picture: GaugePicture,
}

impl Gauge {
    /// Finds the plateaus of every picture.
    ///
    /// # Errors
    /// [`Usage`] for pictures of different sizes or a number of plateaus other than the number of heights; pictures
    /// that cannot be read.
    pub(super) fn find(args: &StepsArgs, settings: &Settings) -> anyhow::Result<Self> {
        let mut gauge = Self {
            sources: Vec::new(),
            plateaus: Vec::new(),
            picture: GaugePicture { size_px: [0, 0], direction: StripeDirection::Horizontal },
        };
        let bar = progress_bar(Some(args.sources.len() as u64), "pictures");
        for (number, Source { path, heights }) in args.sources.iter().enumerate() {
            let name = path.display();
            let GaugeStripe { points, picture, frames } = line::find(path, settings)?;
            tracing::debug!("{name}: {} points in {frames} frames", points.len());
            if !gauge.sources.is_empty() && picture.size_px != gauge.picture.size_px {
                let ([w, h], [w0, h0]) = (picture.size_px, gauge.picture.size_px);
                let text = format!(
                    "{name} has {w} x {h} pixels, those before {w0} x {h0}: all pictures must come from one camera"
                );
                return Err(Usage(text).into());
            }
            gauge.picture = picture;
            let heights: Vec<_> = heights.iter().map(|height| stated(args, *height)).collect();
            let mut found = find_plateaus(&points, &heights).map_err(|error| match error {
                PlateauError::TooFewPoints { .. } => anyhow!("{name}: {error}"),
                _ => Usage(format!("{name}: {error}{}", hint(&error, settings))).into(),
            })?;
            for found in &mut found {
                found.plateau.picture = number;
            }
            gauge.sources.extend(found.iter().map(|_| path.clone()));
            gauge.plateaus.extend(found);
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(gauge)
    }
}

/// Returns a height with the uncertainty of the whole gauge, unless it has its own.
fn stated(args: &StepsArgs, height: GaugeHeight) -> GaugeHeight {
    GaugeHeight { sigma_m: height.sigma_m.or(args.gauge.gauge_sigma), ..height }
}

/// Suggests a remedy for an unexpected number of plateaus.
fn hint(error: &PlateauError, settings: &Settings) -> String {
    let PlateauError::Count { wanted, found, .. } = error else { return String::new() };
    if found > wanted {
        return "; give a height for each, as in FILE=0mm,2mm,0mm".to_owned();
    }
    let areas = settings.cameras.iter().map(|c| c.scanner.extraction.min_segment_area);
    let area = areas.max().unwrap_or_default();
    format!(
        "; pieces of the stripe of fewer than {area} pixels are left out (extraction.min_segment_area)"
    )
}
