//! Why views determine no camera.

use thiserror::Error;

use super::view_variety::MissingViews;

/// The reason why views determine no camera.
#[derive(Debug, Error)]
pub enum CameraError {
    /// Pictures are missing.
    #[error(transparent)]
    Missing(#[from] MissingViews),
    /// The equations have no solution.
    #[error(
        "no camera explains these boards ({0}). Is the target right, are all pictures from one camera with one focus?"
    )]
    Unsolved(String),
    /// The fields of the board are not square.
    #[error(
        "fields look {width_mm:.0} x {height_mm:.0} mm (along {columns} and {rows} corners), or another size with the ratio \
         {ratio:.4} ± {sigma:.4}: --target says squares of {square_mm:.1} mm. Pictures do not show the size: measure \
         several fields with a ruler, and print the board with square fields and without scaling"
    )]
    Rectangular {
        /// Likely width of a field, along the target's columns, millimetres.
        width_mm: f64,
        /// Likely height of a field, millimetres.
        height_mm: f64,
        /// Corners along the target's columns.
        columns: u32,
        /// Corners along the target's rows.
        rows: u32,
        /// Height divided by width.
        ratio: f64,
        /// One standard deviation of the ratio.
        sigma: f64,
        /// Side of a square as told, millimetres.
        square_mm: f64,
    },
    /// The parameters are not determined.
    #[error(
        "the views do not determine {parameters}: more views are needed with the board tilted by 20 to 40 degrees each way \
         and in all parts of the image, or a lens model with fewer coefficients"
    )]
    Vague {
        /// Names of the parameters that are not determined.
        parameters: String,
    },
}
