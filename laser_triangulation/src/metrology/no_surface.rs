//! The condition that every tool for areas requires: the profiles lie at different places.
//!
//! All points of profiles at one place lie in the laser plane, whatever the shape of the part. A plane through them is the laser
//! plane, a map of them has no area, and the scatter about it is zero: figures that look good and mean nothing.

use nalgebra::{Matrix2, Point3, Vector2, Vector3};
use thiserror::Error;

use super::surface::{Surface, is_measured};

/// Movement up to which two positions are equal, metres and radians: rounding errors.
const EQUAL: f64 = 1e-9;
/// Points of a scan scatter within its laser plane and not across it. A fitted plane with less than this share of the
/// scatter across it is the laser plane.
const LEAST_ACROSS: f64 = 1e-3;

/// The reason that the points of a scan are no surface.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum NoSurface {
    /// The points are those of one profile.
    #[error("there is only one profile, which is a line and no surface")]
    OneProfile,
    /// The part did not move between the profiles.
    #[error(
        "the {profiles} profiles lie at one place: without a motion between them they are a line and no surface"
    )]
    OnePlace {
        /// Number of profiles.
        profiles: usize,
    },
}

impl Surface {
    /// Checks that the points are a surface, as the tools for areas require. Seen from above, profiles at different places
    /// extend further across the stripe than half the distance of neighbouring points in a profile.
    ///
    /// # Errors
    /// There is one profile, or all lie at one place. A surface without points is neither.
    pub fn check(&self) -> Result<(), NoSurface> {
        match self.num_profiles() {
            0 => Ok(()),
            1 => Err(NoSurface::OneProfile),
            profiles if self.narrow_extent_m() < 0.5 * self.pitch_m()[0] => {
                Err(NoSurface::OnePlace { profiles })
            }
            _ => Ok(()),
        }
    }

    /// Returns the extent of the points across their longest direction, seen from above, metres.
    fn narrow_extent_m(&self) -> f64 {
        let places = || self.measured().map(|(_, point)| point.xy().coords);
        let num = places().count().max(1) as f64;
        let middle = places().sum::<Vector2<f64>>() / num;
        let mut spread = Matrix2::zeros();
        places().map(|place| place - middle).for_each(|from| spread += from * from.transpose());
        let eigen = spread.symmetric_eigen();
        let narrow = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let across = places().map(|place| (place - middle).dot(&narrow));
        let [low, high] = across.fold([0.0_f64; 2], |[low, high], a| [low.min(a), high.max(a)]);
        high - low
    }

    /// Returns true if the points scatter in a plane with this normal and not across it: it is the laser plane, or contains
    /// the line through the points, whose noise it follows.
    pub(super) fn is_laser_plane(&self, normal: &Vector3<f64>) -> bool {
        let width = self.width.max(1);
        let [in_rows, in_columns] =
            [1, width].map(|stride| self.roughness(stride, normal)).map(|(num, across, inside)| {
                (num > 0).then_some(across < LEAST_ACROSS.powi(2) * inside)
            });
        in_rows.or(in_columns).unwrap_or(false)
    }

    /// Returns the number of triples of neighbours, and the sums of squares of their bends along `normal` and across both it and
    /// the triple; `stride` 1 along the rows, the width along the columns. Bends of rounding errors do not count.
    fn roughness(&self, stride: usize, normal: &Vector3<f64>) -> (usize, f64, f64) {
        let (mut num, mut across, mut inside) = (0, 0.0, 0.0);
        for at in 2 * stride..self.points.len() {
            let triple = [at - 2 * stride, at - stride, at];
            if stride == 1 && triple[0] / self.width.max(1) != at / self.width.max(1) {
                continue;
            }
            let [a, b, c] = triple.map(|at| self.points[at]);
            if ![a, b, c].iter().all(is_measured) {
                continue;
            }
            num += 1;
            let bend = (a.coords + c.coords) - 2.0 * b.coords;
            let Some(sideways) = normal.cross(&(c - a)).try_normalize(0.0) else { continue };
            let is_rounding = bend.norm() < rounding_m(&[a, b, c]);
            if !is_rounding {
                across += bend.dot(normal).powi(2);
                inside += bend.dot(&sideways).powi(2);
            }
        }
        (num, across, inside)
    }
}

/// Returns the rounding error of points from 32-bit floats, metres.
fn rounding_m(points: &[Point3<f64>; 3]) -> f64 {
    4.0 * f64::from(f32::EPSILON)
        * points.iter().map(|point| point.coords.amax()).fold(0.0, f64::max)
}

/// Checks the positions of a scan's profiles along its motion, metres or radians: the condition of [`Surface::check`] where the
/// positions are known.
///
/// # Errors
/// There is one profile, or all have one position. A scan without profiles is neither.
pub fn check_positions(positions: impl IntoIterator<Item = f64>) -> Result<(), NoSurface> {
    let (mut profiles, mut first) = (0, 0.0);
    for position in positions {
        if profiles == 0 {
            first = position;
        } else if (position - first).abs() > EQUAL {
            return Ok(());
        }
        profiles += 1;
    }
    match profiles {
        0 => Ok(()),
        1 => Err(NoSurface::OneProfile),
        _ => Err(NoSurface::OnePlace { profiles }),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;
    use crate::metrology::{
        noise::surface,
        plane::{self, FormError},
        sphere,
    };

    const SIGMA_M: f64 = 3e-6;

    /// Profiles of these shapes at one place, in the laser plane turned by `turn`.
    fn standing(z: impl Fn(f64, f64) -> f64, turn: Rotation3<f64>, seed: u64) -> Surface {
        let mut scan = surface(z, SIGMA_M, 1, seed);
        for point in &mut scan.points {
            *point = turn * Point3::new(point.x, 0.0, point.z);
        }
        scan
    }

    #[test]
    fn profiles_at_one_place_are_no_surface_whatever_their_shape() {
        let shapes: [fn(f64, f64) -> f64; 4] =
            [|_, _| 0.01, |x, _| 0.2 * x, |x, _| 1e-3 * (2e3 * x).sin(), |x, y| 0.1 * x + 0.3 * y];
        let turns = [
            Rotation3::identity(),
            Rotation3::from_euler_angles(0.0, 0.0, 0.7),
            Rotation3::from_euler_angles(0.0, 0.0, -2.0),
        ];
        for (number, shape) in shapes.iter().enumerate() {
            for turn in turns {
                let scan = standing(shape, turn, number as u64);
                assert_eq!(scan.check(), Err(NoSurface::OnePlace { profiles: 50 }), "{number}");
                let error = plane::fit(&scan).unwrap_err();
                assert_eq!(error, NoSurface::OnePlace { profiles: 50 }.into());
                assert!(sphere::fit(&scan).is_err());
            }
        }
    }

    #[test]
    fn noise_of_a_standing_axis_is_no_extent() {
        let mut scan = standing(|_, _| 0.01, Rotation3::identity(), 1);
        for (at, point) in scan.points.iter_mut().enumerate() {
            point.y += 2e-6 * ((at / 60 * 7919) % 11) as f64;
        }
        assert_eq!(scan.check(), Err(NoSurface::OnePlace { profiles: 50 }));
    }

    #[test]
    fn a_plane_through_one_place_in_a_levelled_frame_is_the_laser_plane() {
        // Seen from above, an inclined laser plane has an area.
        let turn = Rotation3::from_euler_angles(0.5, 0.1, 0.3);
        for (number, amplitude_m) in [1e-3, 0.3e-3, 3e-3].into_iter().enumerate() {
            let bump = |x: f64, y: f64| amplitude_m * ((2e3 * x).sin() + 300.0 * y);
            let scan = standing(bump, turn, number as u64);
            let error = plane::fit(&scan).unwrap_err();
            assert!(matches!(error, FormError::NoSurface(_)), "{amplitude_m}: {error}");
        }
    }

    #[test]
    fn one_profile_of_any_shape_is_no_plane() {
        let shapes: [fn(f64, f64) -> f64; 3] =
            [|_, _| 0.0, |x, _| 0.3 * x, |x, _| 1e-3 * (1e3 * x).cos()];
        for shape in shapes {
            let mut scan = surface(shape, SIGMA_M, 1, 3);
            scan.points.truncate(60);
            assert_eq!(scan.check(), Err(NoSurface::OneProfile));
            assert_eq!(plane::fit(&scan).unwrap_err(), NoSurface::OneProfile.into());
            // The same profile in a scan whose other profiles are excluded.
            let whole = surface(shape, SIGMA_M, 1, 3);
            let is_used: Vec<bool> = (0..whole.points.len()).map(|at| at / 60 == 7).collect();
            let error = plane::fit_where(&whole, &is_used).unwrap_err();
            assert_eq!(error, NoSurface::OneProfile.into());
        }
    }

    #[test]
    fn one_column_of_a_scan_is_no_plane() {
        let whole = surface(|x, y| 0.1 * x + 0.05 * y, SIGMA_M, 1, 5);
        let is_used: Vec<bool> = (0..whole.points.len()).map(|at| at % 60 == 30).collect();
        let error = plane::fit_where(&whole, &is_used).unwrap_err();
        assert!(matches!(error, FormError::NoSurface(_)), "{error}");
    }

    #[test]
    fn scans_are_surfaces() {
        let shapes: [fn(f64, f64) -> f64; 3] =
            [|_, _| 0.0, |x, y| 0.3 * x - 0.8 * y, |x, y| 1e-3 * (1e3 * x).cos() + y * 2.0];
        for sigma_m in [0.0, SIGMA_M] {
            for shape in shapes {
                let scan = surface(shape, sigma_m, 1, 3);
                assert_eq!(scan.check(), Ok(()));
                plane::fit(&scan).unwrap();
                // Two profiles and two columns are enough.
                let mut two = scan.clone();
                two.points.truncate(120);
                assert_eq!(two.check(), Ok(()));
            }
        }
        assert_eq!(Surface::default().check(), Ok(()));
    }

    #[test]
    fn positions_are_checked_where_they_are_known() {
        assert_eq!(check_positions([]), Ok(()));
        assert_eq!(check_positions([0.3]), Err(NoSurface::OneProfile));
        assert_eq!(check_positions([0.3; 5]), Err(NoSurface::OnePlace { profiles: 5 }));
        assert_eq!(check_positions([0.3, 0.3, 0.300_01]), Ok(()));
        assert_eq!(check_positions([0.0, 0.1, 0.0]), Ok(()), "there and back");
    }
}
