//! Measuring tools for scanned points: planes, steps, spheres, volumes, regular height maps. Pure: no file,
//! socket, thread or clock. Every figure comes with its uncertainty.

pub(crate) mod robust;
pub(crate) mod student;
pub(crate) mod correlation;
pub(crate) mod plateaus;
pub mod surface;
pub mod no_surface;
pub mod form;
pub mod plane;
pub mod between_profiles;
pub mod sphere;
pub mod step_height;
pub mod height_map;
pub mod volume;
pub mod part;
pub mod deviation;
pub mod calibration_error;
#[cfg(test)]
mod noise;

pub use between_profiles::BetweenProfiles;
pub use deviation::{Deviation, deviations};
pub use form::Form;
pub use height_map::{CellState, GridError, GridLayout, RegularHeightMap, Resampler};
pub use no_surface::{NoSurface, check_positions};
pub use plane::{FormError, PlaneFit};
pub use plateaus::PlateauError;
pub use sphere::SphereFit;
pub use step_height::{StepHeight, StepHeightError};
pub use student::NORMAL_95;
pub use surface::{Region, Surface};
pub use volume::Volume;
