//! Options of inputs that are pictures.

use std::path::PathBuf;

use crate::bag::PictureOptions;

/// Stamps and positions of pictures.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct PictureArgs {
    /// Pictures per second: picture n gets the stamp n / HZ, counted from 1. Without it the stamps assume 10 Hz, and
    /// motion.velocity is refused; videos have stamps of their own; motion.step, the movement from picture to picture, needs no rate.
    #[arg(long, value_name = "HZ", value_parser = frame_rate)]
    pub(super) frame_rate: Option<f64>,
    /// CSV file of stamps and positions of the pictures. Its first line names the columns: file (name of the picture), and
    /// at least one of `stamp_s` (seconds) and position (metres or radians). Positions are the source of the motion unless
    /// motion.source is set.
    #[arg(long, value_name = "FILE.csv")]
    pub(super) positions: Option<PathBuf>,
}

impl PictureArgs {
    /// Returns the options for the reader.
    pub(super) fn options(self) -> PictureOptions {
        PictureOptions { frame_rate_hz: self.frame_rate, positions: self.positions }
    }
}

fn frame_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (1e-6..=1e6).contains(rate));
    rate.ok_or_else(|| "a rate in hertz from 0.000001 to 1000000".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_rate_is_a_positive_number() {
        assert_eq!(frame_rate("29.97"), Ok(29.97));
        for text in ["0", "-5", "nan", "inf", "30fps", ""] {
            assert!(frame_rate(text).unwrap_err().contains("hertz"), "{text}");
        }
    }
}
