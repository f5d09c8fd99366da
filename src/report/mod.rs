//! Pages for people: what a scan shows, and how two results of one recording differ. Each is one HTML file that needs no
//! network, in a light and a dark dress.
//!
//! What lies where on a page, for scripts and tests:
//!
//! | id | what |
//! |---|---|
//! | `height-map` | canvas: the heights from above, in colour, with axes; takes the pointer and the arrow keys |
//! | `section-across`, `section-along` | the profile under the pointer, and the line along the motion through the same point |
//! | `readout` | position and height under the pointer, as text |
//! | `color-low`, `color-high`, `color-reset` | the ends of the scale of colours |
//! | `chart-…` | one figure a [`chart::Chart`] |
//! | `report-data`, `map-data` | what is drawn: JSON, and the packed [`grid::Grid`] |
//!
//! The drawing of curves in the page is uPlot's (`src/report/uplot`, MIT licence, unchanged).

pub mod pack;
pub(crate) mod date;
pub(crate) mod color;
pub mod grid;
pub mod series;
pub mod quality;
pub mod chart;
pub mod overlay;
pub mod spread;
pub mod difference;
pub mod page;
mod status;
mod gathered;
mod described;
mod images;
pub(crate) mod frames;
pub(crate) mod map;
pub(crate) mod scan_report;
pub(crate) mod comparison;
mod comparison_page;

/// Name and version of the program, as pages state them.
const PROGRAM: &str = concat!("laser_profiler ", env!("CARGO_PKG_VERSION"));
