//! What the calibration's own uncertainty does to a measured point: it is common to all points of a recording, so that no
//! mean over them makes it smaller.

use nalgebra::{DMatrix, DVector, Isometry3, Point2, Point3, Unit};

use super::CameraAndPlane;
use crate::scanner::{camera::Camera, params::StripeDirection};

/// Two tilts and the distance.
const PLANE_VALUES: usize = 3;

impl CameraAndPlane {
    /// Covariance of measured places from that of camera and plane: rows and columns are x and z of each point in turn,
    /// square metres. Given are x and z in the profiles' frame, metres. `None` where the file does not say how well camera
    /// and plane are known, or the camera cannot see a point.
    ///
    /// First-order propagation (GUM, JCGM 100:2008, equation 13) with differences over ±1 standard deviation. Camera and
    /// plane count as independent. The frame of the profiles moves with the calibration: so does what is called x and z.
    pub fn covariance_at(
        &self,
        direction: StripeDirection,
        points_m: &[[f64; 2]],
    ) -> Option<DMatrix<f64>> {
        let covariance = self.covariance()?;
        let camera_from_laser: Isometry3<f64> = self.camera_from_laser(direction);
        let pixels: Vec<Point2<f64>> = points_m
            .iter()
            .map(|[x_m, z_m]| self.camera.project(camera_from_laser * Point3::new(*x_m, 0.0, *z_m)))
            .collect::<Option<_>>()?;
        let mut sensitivities = DMatrix::zeros(2 * points_m.len(), covariance.nrows());
        for value in 0..covariance.nrows() {
            let sigma = covariance[(value, value)].sqrt();
            if sigma > 0.0 {
                let above = self.moved(value, sigma)?.places(direction, &pixels)?;
                let below = self.moved(value, -sigma)?.places(direction, &pixels)?;
                sensitivities.set_column(value, &((above - below) / (2.0 * sigma)));
            }
        }
        Some(&sensitivities * covariance * sensitivities.transpose())
    }

    /// One standard deviation of x and of z of a place in the profiles' frame, from the calibration alone, metres; see
    /// [`covariance_at`](Self::covariance_at).
    pub fn sigma_from_calibration(
        &self,
        direction: StripeDirection,
        point_m: [f64; 2],
    ) -> Option<[f64; 2]> {
        let covariance = self.covariance_at(direction, &[point_m])?;
        Some([0, 1].map(|k| covariance[(k, k)].sqrt()))
    }

    /// Of the camera's estimated values in the order of their names, then of the plane's tilts and distance.
    fn covariance(&self) -> Option<DMatrix<f64>> {
        let camera = self.camera_quality.as_ref()?;
        let plane = self.plane_quality.as_ref()?.covariance?;
        let count = camera.parameters.len();
        if count == 0 || camera.covariance.len() != count * count {
            return None;
        }
        let mut all = DMatrix::zeros(count + PLANE_VALUES, count + PLANE_VALUES);
        let of_camera = DMatrix::from_row_slice(count, count, &camera.covariance);
        all.view_mut((0, 0), (count, count)).copy_from(&of_camera);
        let of_plane = DMatrix::from_row_slice(PLANE_VALUES, PLANE_VALUES, &plane);
        all.view_mut((count, count), (PLANE_VALUES, PLANE_VALUES)).copy_from(&of_plane);
        Some(all)
    }

    /// The same with one value, by its place in the covariance, larger by `change`.
    fn moved(&self, value: usize, change: f64) -> Option<Self> {
        let mut moved = self.clone();
        let names = &self.camera_quality.as_ref()?.parameters;
        if let Some(name) = names.get(value) {
            *moved.camera.value_mut(name)? += change;
            return Some(moved);
        }
        match value - names.len() {
            tilt @ 0..=1 => {
                let normal = self.plane.normal.into_inner() + self.plane.tangents()[tilt] * change;
                moved.plane.normal = Unit::new_normalize(normal);
            }
            _ => moved.plane.distance_m += change,
        }
        Some(moved)
    }

    /// x and z of each pixel in turn.
    fn places(&self, direction: StripeDirection, pixels: &[Point2<f64>]) -> Option<DVector<f64>> {
        let mut cuts = self.cuts(direction);
        let mut places = Vec::with_capacity(2 * pixels.len());
        for pixel in pixels {
            let (along_px, across_px) = match direction {
                StripeDirection::Horizontal => (pixel.x, pixel.y),
                StripeDirection::Vertical => (pixel.y, pixel.x),
            };
            let place = cuts.place(along_px, across_px)?;
            places.extend([place.x_m, place.z_m]);
        }
        Some(DVector::from_vec(places))
    }
}

impl Camera {
    /// A value by its name in a covariance: fx, fy, cx, cy, the distortion's coefficients, `tau_x`, `tau_y`.
    pub(crate) fn value_mut(&mut self, name: &str) -> Option<&mut f64> {
        match name {
            "fx" => Some(&mut self.fx_px),
            "fy" => Some(&mut self.fy_px),
            "cx" => Some(&mut self.cx_px),
            "cy" => Some(&mut self.cy_px),
            "tau_x" => Some(&mut self.tilt_rad[0]),
            "tau_y" => Some(&mut self.tilt_rad[1]),
            _ => self.distortion.coefficient_mut(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Cholesky, Matrix3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::scanner::calibration::{CameraQuality, PlaneQuality, tests::rig};

    /// Four values of a camera and three of a plane, correlated.
    fn known() -> CameraAndPlane {
        let camera_sigma = [1.1, 1.1, 0.8, 0.004];
        let mut camera =
            DMatrix::from_diagonal(&DVector::from_iterator(4, camera_sigma.map(|s| s * s)));
        let correlated = 0.9 * camera_sigma[0] * camera_sigma[1];
        (camera[(0, 1)], camera[(1, 0)]) = (correlated, correlated);
        let plane_sigma = [4e-4, 3e-4, 2.5e-4];
        let mut plane = Matrix3::from_diagonal(&plane_sigma.map(|s| s * s).into());
        let correlated = -0.5 * plane_sigma[0] * plane_sigma[2];
        (plane[(0, 2)], plane[(2, 0)]) = (correlated, correlated);
        CameraAndPlane {
            camera_quality: Some(CameraQuality {
                rms_px: 0.1,
                views_used: 100,
                views_rejected: 0,
                parameters: ["fx", "fy", "cx", "k1"].map(str::to_owned).into(),
                covariance: camera.as_slice().to_vec(),
            }),
            plane_quality: Some(PlaneQuality {
                rms_m: 0.0005,
                boards_used: 20,
                covariance: plane.as_slice().try_into().ok(),
            }),
            ..rig()
        }
    }

    #[test]
    fn the_stated_uncertainty_is_the_scatter_of_calibrations_that_might_have_been() {
        const DRAWS: usize = 4000;
        let (known, direction) = (known(), StripeDirection::Vertical);
        let points = [[-0.05, 0.03], [0.04, -0.02]];
        let stated = known.covariance_at(direction, &points).unwrap();
        let factor = Cholesky::new(known.covariance().unwrap()).unwrap().l();
        let pose = known.camera_from_laser(direction);
        let pixels =
            points.map(|[x, z]| known.camera.project(pose * Point3::new(x, 0.0, z)).unwrap());
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut draws = DMatrix::zeros(4, DRAWS);
        for draw in 0..DRAWS {
            let normal = DVector::from_fn(7, |_, _| StandardNormal.sample(&mut random));
            let change: DVector<f64> = &factor * normal;
            let other = (0..7).try_fold(known.clone(), |rig, k| rig.moved(k, change[k])).unwrap();
            draws.set_column(draw, &other.places(direction, &pixels).unwrap());
        }
        let middle = draws.column_mean();
        draws.column_iter_mut().for_each(|mut column| column -= &middle);
        let scatter = &draws * draws.transpose() / (DRAWS - 1) as f64;
        // With 4000 draws a standard deviation is known to 1.1 %, and twice that twice as well.
        for k in 0..4 {
            let ratio = (scatter[(k, k)] / stated[(k, k)]).sqrt();
            assert!((ratio - 1.0).abs() < 0.045, "{k}: {ratio}");
        }
        // What both points share does not count in their difference.
        let of = |c: &DMatrix<f64>| (c[(1, 1)] + c[(3, 3)] - 2.0 * c[(1, 3)]).sqrt();
        assert!((of(&scatter) / of(&stated) - 1.0).abs() < 0.045);
        assert!(of(&stated) < 0.8 * (stated[(1, 1)] + stated[(3, 3)]).sqrt());
    }

    #[test]
    fn what_the_file_does_not_say_is_not_stated() {
        let direction = StripeDirection::Vertical;
        assert!(known().sigma_from_calibration(direction, [0.0, 0.0]).is_some());
        assert_eq!(rig().sigma_from_calibration(direction, [0.0, 0.0]), None);
        let mut without = known();
        without.camera_quality.as_mut().unwrap().covariance.clear();
        assert_eq!(without.sigma_from_calibration(direction, [0.0, 0.0]), None);
    }
}
