//! Point clouds as PLY and PCD files: a header with the number of points, then binary points.

use std::io::Write;

use super::Written;
use crate::{cli::chart::viridis, scanner::scan::Point};

/// Format of a point cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CloudFormat {
    /// Stanford's polygon file, binary little endian.
    Ply,
    /// The Point Cloud Library's file, version 0.7, binary.
    Pcd,
}

/// Writer of one point cloud.
pub(super) struct CloudWriter<W> {
    file: W,
    /// Colour scale of heights, metres; `None` without colours.
    scale_m: Option<[f32; 2]>,
    left: u64,
    written: u64,
}

impl<W: Write> CloudWriter<W> {
    /// Writes the header. `scale_m` is the colour scale of heights, metres; only PLY files have colours.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn begin(
        mut file: W,
        format: CloudFormat,
        num_points: u64,
        scale_m: Option<[f32; 2]>,
    ) -> anyhow::Result<Self> {
        let scale_m = scale_m.filter(|_| format == CloudFormat::Ply);
        match format {
            CloudFormat::Ply => {
                let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
                write!(
                    file,
                    "ply\nformat binary_little_endian 1.0\ncomment metres: x along the stripe, y along the motion, z up\n\
                     element vertex {num_points}\nproperty float x\nproperty float y\nproperty float z\n\
                     property float intensity\n{}end_header\n",
                    if scale_m.is_some() { colors } else { "" }
                )?;
            }
            CloudFormat::Pcd => write!(
                file,
                "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\n\
                 TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {num_points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n\
                 POINTS {num_points}\nDATA binary\n"
            )?,
        }
        Ok(Self { file, scale_m, left: num_points, written: 0 })
    }

    /// Writes a point.
    ///
    /// # Errors
    /// The file cannot be written, or has more points than its header states: the recording has changed.
    pub(super) fn point(&mut self, point: &Point) -> anyhow::Result<()> {
        anyhow::ensure!(self.left > 0, "the recording changed while it was read");
        let mut bytes = [0; 16];
        for (place, number) in bytes.chunks_exact_mut(4).zip(point) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        self.file.write_all(&bytes)?;
        if let Some(scale_m) = self.scale_m {
            let color = viridis(point[2], scale_m);
            self.file.write_all(&[color.0, color.1, color.2])?;
        }
        self.left -= 1;
        self.written += 1;
        Ok(())
    }

    /// Ends the file and returns its number of points.
    ///
    /// # Errors
    /// The file has fewer points than its header states: the recording has changed.
    pub(super) fn finish(self) -> anyhow::Result<Written> {
        anyhow::ensure!(self.left == 0, "the recording changed while it was read");
        Ok(Written { num_points: self.written, num_lost: 0 })
    }
}
