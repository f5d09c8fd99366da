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
pub mod grid;
pub mod series;
pub mod quality;
pub mod chart;
pub mod overlay;
pub mod spread;
pub mod difference;
pub mod page;
