//! The simulated rigs. The simulator's lens projects, which is not that of the calibration.

use nalgebra::{Point2, Point3, Unit, Vector3};

use super::*;
use crate::{
    calibrate::LensModel,
    scanner::{
        axis::{Axis, AxisKind},
        params::StripeDirection,
    },
    simulate::rig::Lens,
};

/// A rig, and how it is calibrated.
#[derive(Clone)]
pub(super) struct SimulatedRig {
    /// The true lens.
    pub(super) lens: Lens,
    /// Columns and rows of the images.
    pub(super) size_px: [u32; 2],
    /// Normal of the laser plane, of any length.
    pub(super) normal: Vector3<f64>,
    /// Distance of the laser plane from the lens, metres.
    pub(super) distance_m: f64,
    /// Direction of the stripe.
    pub(super) direction: StripeDirection,
    /// Model of the lens that is fitted.
    pub(super) model: LensModel,
    /// Side of the board's squares, metres.
    pub(super) square_m: f64,
    /// Nearest and farthest board, metres.
    pub(super) depths_m: [f64; 2],
    /// Views for the camera, and with the laser.
    pub(super) views: [usize; 2],
    /// Standard deviation of corners, and of the stripe across, pixels.
    pub(super) noise_px: [f64; 2],
    /// Coefficients of the bend of all boards, 1/m.
    pub(super) bend_per_m: [f64; 3],
    /// The axis that moves the part; `None`: along the laser plane's normal, exactly.
    pub(super) axis: Option<Axis>,
}

impl SimulatedRig {
    /// A horizontal stripe.
    fn new() -> Self {
        Self {
            lens: Lens {
                focal_px: [1600.0, 1605.0],
                center_px: [651.0, 502.0],
                distortion: [-0.11, 0.08, 0.0007, -0.0005, 0.0, 0.0, 0.0, 0.0],
                equidistant: None,
                tilt_rad: [0.0; 2],
            },
            size_px: [1280, 1024],
            normal: Vector3::new(0.1, -0.8, 0.6),
            distance_m: 0.24,
            direction: StripeDirection::Horizontal,
            model: LensModel::PlumbBob,
            square_m: 0.02,
            depths_m: [0.33, 0.5],
            views: [12, 9],
            noise_px: [0.08, 0.1],
            bend_per_m: [0.0; 3],
            axis: None,
        }
    }

    /// A horizontal stripe, and ten views only.
    pub(super) fn with_few_views() -> Self {
        Self { views: [10, 7], ..Self::new() }
    }

    /// As many views as the documentation asks for.
    pub(super) fn with_many_views() -> Self {
        Self { views: [20, 20], ..Self::new() }
    }

    /// A small image, and a vertical stripe from the side.
    pub(super) fn wide() -> Self {
        let rig = Self::new();
        let lens = Lens {
            focal_px: [520.0, 518.0],
            center_px: [310.0, 246.0],
            distortion: [-0.28, 0.09, 0.0, 0.0, -0.01, 0.0, 0.0, 0.0],
            ..rig.lens
        };
        Self {
            lens,
            size_px: [640, 480],
            normal: Vector3::new(0.9, -0.1, 0.42),
            distance_m: 0.2,
            direction: StripeDirection::Vertical,
            square_m: 0.03,
            depths_m: [0.35, 0.7],
            ..rig
        }
    }

    /// A narrow field of view, and three times the noise.
    pub(super) fn long() -> Self {
        let rig = Self::new();
        let lens = Lens {
            focal_px: [3500.0, 3500.0],
            distortion: [0.05, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            ..rig.lens
        };
        Self {
            lens,
            normal: Vector3::new(0.0, -0.5, 0.8),
            distance_m: 0.5,
            depths_m: [0.55, 0.75],
            noise_px: [0.25, 0.3],
            ..rig
        }
    }

    /// Boards with a bow of a millimetre.
    pub(super) fn with_a_bent_board() -> Self {
        Self { bend_per_m: [0.1, 0.03, -0.05], views: [20, 20], ..Self::new() }
    }

    /// A turntable whose axis is calibrated from a board on it.
    pub(super) fn with_a_turntable() -> Self {
        let direction = Unit::new_normalize(Vector3::new(0.0, -0.6, -0.75));
        let (kind, point_m) = (AxisKind::Revolute, Point3::new(0.0, 0.05, 0.4));
        Self { axis: Some(Axis { kind, point_m, direction, scale: 1.0 }), ..Self::new() }
    }

    /// The true laser plane.
    pub(super) fn plane(&self) -> LaserPlane {
        LaserPlane { normal: Unit::new_normalize(self.normal), distance_m: self.distance_m }
    }

    /// Returns where the image shows a point, pixels; `None` outside the image.
    pub(super) fn sees(&self, point: Point3<f64>) -> Option<Point2<f64>> {
        let [u, v] = self.lens.project(point.into())?;
        let inside = |at: f64, size: u32| (0.0..f64::from(size - 1)).contains(&at);
        (inside(u, self.size_px[0]) && inside(v, self.size_px[1])).then(|| Point2::new(u, v))
    }
}
