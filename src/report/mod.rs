//! Reports of a scan and comparisons of two results, as self-contained HTML pages in a light and a dark theme.
//!
//! Elements of a page, for scripts and tests:
//!
//! | id | element |
//! |---|---|
//! | `height-map` | canvas with the heights in colour and axes; responds to the pointer and the arrow keys |
//! | `section-across`, `section-along` | the profile under the pointer, and the section along the motion through the same point |
//! | `readout` | position and height under the pointer, as text |
//! | `color-low`, `color-high`, `color-reset` | the ends of the colour scale |
//! | `chart-…` | one `chart::Chart` |
//! | `report-data`, `map-data` | the data: JSON, and the packed `grid::Grid` |
//!
//! uPlot (`src/report/uplot`, MIT licence, unchanged) draws the curves.

pub(crate) mod pack;
pub(crate) mod date;
pub(crate) mod color;
pub(crate) mod grid;
pub(crate) mod series;
pub(crate) mod quality;
pub(crate) mod chart;
pub(crate) mod overlay;
pub(crate) mod spread;
pub(crate) mod difference;
pub(crate) mod page;
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
