//! Views of boards, with the laser's line on them, and what is calibrated from them.

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::{rig::SimulatedRig, *};
use crate::{
    calibrate::{
        AxisTarget, AxisView, Board, BoardView, CameraViews, Checkerboard, Corner, Light,
        LitCenterline, SeenTarget, calibrate_axis, calibrate_camera,
    },
    scanner::{
        axis::{AxisKind, RawPosition},
        params::{Channel, StripeDirection},
        stripe::Centerline,
    },
};

/// Inner corners along the columns and along the rows.
const CORNERS: [u32; 2] = [9, 6];
/// Corners that a view shows at least: boards may reach beyond the image.
const MIN_CORNERS: usize = 30;
/// Points of a line at least.
const MIN_POINTS: usize = 100;
/// Pictures of a board on an axis at least.
const MIN_MOVED: usize = 12;
/// Places on a board that are tried as points of its line, which become one a pixel.
const PLACES: u32 = 4000;

#[derive(Clone)]
struct PosedBoard {
    /// Pose of its middle in the camera's frame.
    pose: Isometry3<f64>,
    /// Its bend, 1/m.
    bend_per_m: [f64; 3],
    board: Board,
}

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

impl PosedBoard {
    /// Returns the point at a place on the board, in the camera's frame.
    fn point(&self, at: Vector2<f64>) -> Point3<f64> {
        self.pose * bent(self.bend_per_m, at)
    }

    /// Returns places on the board along the line on which a plane meets it, relative to the middle, metres.
    fn cut(&self, plane: &LaserPlane, reach_m: f64) -> impl Iterator<Item = Vector2<f64>> {
        let normal = self.pose.rotation.inverse() * plane.normal.into_inner();
        let distance_m = plane.distance_m - plane.normal.dot(&self.pose.translation.vector);
        let slope = normal.xy().norm();
        let across = normal.xy() / slope;
        let along = Vector2::new(-across.y, across.x);
        let bend_per_m = self.bend_per_m;
        (0..=PLACES).map(move |place| {
            let t = reach_m * (2.0 * f64::from(place) / f64::from(PLACES) - 1.0);
            let mut at = along * t + across * (distance_m / slope);
            for _ in 0..20 {
                at -= across * ((normal.dot(&bent(bend_per_m, at).coords) - distance_m) / slope);
            }
            at
        })
    }
}

fn bent([a, b, c]: [f64; 3], at: Vector2<f64>) -> Point3<f64> {
    Point3::new(at.x, at.y, a * at.x * at.x + b * at.x * at.y + c * at.y * at.y)
}

impl SimulatedRig {
    /// Returns the target as `--target` names it.
    pub(super) fn target(&self) -> String {
        format!("checkerboard:{}x{}:{}", CORNERS[0], CORNERS[1], self.square_m)
    }

    /// Calibrates the camera from its own views.
    pub(super) fn calibrated_camera(&self, random: &mut impl Rng) -> CameraCalibration {
        let mut boards = Vec::new();
        while boards.len() < self.views[0] {
            boards.extend(self.board(random).map(|posed| posed.board));
        }
        let views = CameraViews {
            boards: &boards,
            width_px: self.size_px[0],
            height_px: self.size_px[1],
            square_m: self.square_m,
        };
        calibrate_camera(&views, self.model).unwrap().calibration("simulated", 0)
    }

    /// Finds the lines on boards that a calibrated camera sees.
    pub(super) fn lines(
        &self,
        camera: &Camera,
        target: &Target,
        random: &mut impl Rng,
    ) -> LaserLines {
        let (mut boards, mut stripes) = (Vec::new(), Vec::new());
        while boards.len() < self.views[1] {
            let Some(posed) = self.board(random) else { continue };
            let centerline = self.stripe(&posed, random);
            if centerline.u_px.len() >= MIN_POINTS {
                let light = Light::Channel(Channel::Auto);
                stripes.push(vec![LitCenterline { light, centerline }]);
                boards.push(posed.board);
            }
        }
        let views = boards.iter().zip(&stripes);
        let views: Vec<_> = views.map(|(board, stripes)| BoardView { board, stripes }).collect();
        LaserLines::find(camera, &views, target, 0.5)
    }

    /// Adds the axis to a calibration, from whole boards that move on it.
    pub(super) fn with_axis(
        &self,
        mut found: CameraAndPlane,
        random: &mut impl Rng,
    ) -> CameraAndPlane {
        let Some(axis) = &self.axis else { return found };
        let step = match axis.kind {
            AxisKind::Prismatic => 0.005,
            AxisKind::Revolute => 0.08,
        };
        let views = loop {
            let Some(first) = self.board(random) else { continue };
            let views = (0..25).filter_map(|place| {
                let stated = step * f64::from(place);
                let pose = axis.pose(RawPosition(stated)) * first.pose;
                let board = self.seen(&PosedBoard { pose, ..first.clone() }, random);
                let is_whole = board.corners.len() == (CORNERS[0] * CORNERS[1]) as usize;
                let (size_px, target) = (self.size_px, SeenTarget::Board(board));
                is_whole.then_some(AxisView { size_px, stated, target, stripes: Vec::new() })
            });
            let views: Vec<_> = views.collect();
            if views.len() >= MIN_MOVED {
                break views;
            }
        };
        let [columns, rows] = CORNERS;
        let board = Checkerboard { columns, rows, square_m: self.square_m };
        let board = Target::Checkerboard(board);
        let fit = calibrate_axis(&found, &AxisTarget::Board(board), &views).unwrap();
        fit.apply_to(&mut found);
        found
    }

    /// Returns a board, its middle anywhere in the image, tilted by up to 40 degrees each way.
    fn board(&self, random: &mut impl Rng) -> Option<PosedBoard> {
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let depth_m = between(self.depths_m[0], self.depths_m[1]);
        let [x, y] = [0, 1].map(|i| {
            let half = 0.5 * f64::from(self.size_px[i]) / self.lens.focal_px[i];
            depth_m * between(-half, half)
        });
        let turns = [between(-0.7, 0.7), between(-0.7, 0.7), between(-0.4, 0.4)];
        let rotation = UnitQuaternion::from_euler_angles(turns[0], turns[1], turns[2]);
        let middle = Translation3::from(Vector3::new(x, y, depth_m));
        let pose = Isometry3::from_parts(middle, rotation);
        let mut posed = PosedBoard { pose, bend_per_m: self.bend_per_m, board: Board::default() };
        posed.board = self.seen(&posed, random);
        (posed.board.corners.len() >= MIN_CORNERS).then_some(posed)
    }

    /// Returns the corners of a board that the image shows.
    fn seen(&self, posed: &PosedBoard, random: &mut impl Rng) -> Board {
        let [columns, rows] = CORNERS;
        let mut corners = Vec::new();
        for place in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
            let off = |at: u32, count: u32| f64::from(at) - 0.5 * f64::from(count - 1);
            let at = Vector2::new(off(place.0, columns), off(place.1, rows)) * self.square_m;
            let Some(seen) = self.sees(posed.point(at)) else { continue };
            let noise = Vector2::new(normal(random), normal(random)) * self.noise_px[0];
            corners.push(Corner { place, seen: seen + noise });
        }
        Board { columns, rows, corners, ..Board::default() }
    }

    /// Returns the laser's line on a board, about one point a pixel.
    fn stripe(&self, posed: &PosedBoard, random: &mut impl Rng) -> Centerline {
        let half_m = CORNERS.map(|corners| 0.5 * f64::from(corners) * self.square_m);
        let mut centerline = Centerline::default();
        let mut last: Option<Point2<f64>> = None;
        for at in posed.cut(&self.plane(), half_m[0].hypot(half_m[1])) {
            if at.x.abs() > half_m[0] || at.y.abs() > half_m[1] {
                continue;
            }
            let Some(seen) = self.sees(posed.point(at)) else { continue };
            if last.is_some_and(|last| (seen - last).norm() < 1.0) {
                continue;
            }
            last = Some(seen);
            let across = self.noise_px[1] * normal(random);
            let noise = match self.direction {
                StripeDirection::Horizontal => Vector2::new(0.0, across),
                StripeDirection::Vertical => Vector2::new(across, 0.0),
            };
            centerline.u_px.push((seen.x + noise.x) as f32);
            centerline.v_px.push((seen.y + noise.y) as f32);
        }
        centerline
    }
}
