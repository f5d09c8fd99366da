//! The part that a projective map leaves out: the curved image of a straight line.

use serde::{Deserialize, Serialize};

use super::{Calibration, CalibrationError, StepsQuality};

/// By how much heights are off because a lens bends the line of light, which no projective map describes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bow {
    /// First and last x of the profiles, metres.
    pub x_m: [f64; 2],
    /// Lowest and highest z, metres.
    pub z_m: [f64; 2],
    /// Independent deviations of z, each one standard deviation, which add in quadrature, metres: each at the start, in the
    /// middle and at the end of `x_m` for the lowest z, then for the middle one, then for the highest. Parabolas lead through
    /// them. The nine belong together: only their common sign is arbitrary.
    pub deviations_m: Vec<[f64; 9]>,
}

/// One deviation of a [`Bow`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deviation {
    x_m: [f64; 2],
    z_m: [f64; 2],
    nodes_m: [f64; 9],
}

impl Bow {
    fn deviations(&self) -> impl Iterator<Item = Deviation> {
        let Self { x_m, z_m, deviations_m } = self;
        deviations_m.iter().map(|nodes_m| Deviation { x_m: *x_m, z_m: *z_m, nodes_m: *nodes_m })
    }

    /// Checks the values of a file.
    pub(super) fn check(quality: Option<&StepsQuality>) -> Result<(), CalibrationError> {
        let Some(bow) = quality.and_then(|quality| quality.bow.as_ref()) else { return Ok(()) };
        let is_range = |[from, to]: [f64; 2]| from.is_finite() && to.is_finite() && from < to;
        let is_finite =
            bow.deviations_m.as_flattened().iter().all(|deviation| deviation.is_finite());
        if is_finite && is_range(bow.x_m) && is_range(bow.z_m) {
            return Ok(());
        }
        let allowed = "finite numbers; the first x and z smaller than the second";
        Err(CalibrationError::value("steps_quality.bow", format!("{bow:?}"), allowed))
    }
}

impl Deviation {
    /// Returns the deviation of z at (x, z) in the laser plane, metres.
    pub(crate) fn at_m(&self, [x_m, z_m]: [f64; 2]) -> f64 {
        let (along, across) = (parabolas(self.x_m, x_m), parabolas(self.z_m, z_m));
        let rows = self.nodes_m.chunks_exact(3).zip(across);
        rows.map(|(row, share)| share * row.iter().zip(along).map(|(z, by)| z * by).sum::<f64>())
            .sum()
    }
}

impl Calibration {
    /// Returns the deviations of z by the lens; none if known heights have not shown any.
    pub(crate) fn deviations(&self) -> impl Iterator<Item = Deviation> {
        let quality = match self {
            Self::VerticalIncidence(geometry) => geometry.quality.as_ref(),
            Self::Projective(geometry) => geometry.quality.as_ref(),
            Self::CameraAndPlane(_) => None,
        };
        let bow = quality.and_then(|quality| quality.bow.as_deref());
        bow.into_iter().flat_map(Bow::deviations)
    }
}

/// Returns the shares of the values at the start, in the middle and at the end of a range in the parabola through them.
fn parabolas([from, to]: [f64; 2], at: f64) -> [f64; 3] {
    let t = 2.0 * (at - from) / (to - from) - 1.0;
    [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of older versions have none. It is a quality, and no part of the id.
    #[test]
    fn the_file_may_state_it() {
        let file = |bow: &str| {
            Calibration::from_yaml(&format!(
                "{{type: projective, frame_id: laser_plane, image_width: 640, image_height: 480, \
                 homography: [1.0e-4, 0, -0.05, 0, -2.0e-4, 0.1, 0, 1.0e-3, 1], steps_quality: {{rms_m: 1.0e-6, heights_used: 4{bow}}}}}"
            ))
        };
        let nine = "[0, 0, 0, 0, 0, 0, 1.0e-6, 0, 2.0e-6]";
        let stated =
            |x: &str| file(&format!(", bow: {{x_m: {x}, z_m: [0, 0.01], deviations_m: [{nine}]}}"));
        let (older, with) = (file("").unwrap(), stated("[-0.05, 0.05]").unwrap());
        assert_eq!(older.deviations().count(), 0);
        let deviation = with.deviations().next().unwrap();
        assert!((deviation.at_m([0.05, 0.01]) - 2e-6).abs() < 1e-15);
        assert_eq!(older.id(), with.id());
        let error = stated("[0.05, 0.05]").unwrap_err().to_string();
        assert!(error.contains("steps_quality.bow"), "{error}");
    }

    #[test]
    fn parabolas_pass_through_the_stated_values() {
        let of = |x: f64, z: f64| (1.0 + 2.0 * x - 3.0 * x * x) * (0.5 - z + 0.7 * z * z);
        let (x_m, z_m) = ([-2.0, 1.0], [0.0, 4.0]);
        let [xs, zs] = [[-2.0, -0.5, 1.0], [0.0, 2.0, 4.0]];
        let nodes_m = std::array::from_fn(|at| of(xs[at % 3], zs[at / 3]));
        let deviation = Deviation { x_m, z_m, nodes_m };
        for (x, z) in [(-2.0, 0.0), (0.3, 1.0), (1.0, 4.0), (1.5, -1.0)] {
            assert!((deviation.at_m([x, z]) - of(x, z)).abs() < 1e-12);
        }
    }
}
