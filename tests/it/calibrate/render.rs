//! Pictures of boards and markers before a known camera, and of the line of a known laser plane on them.

use std::path::Path;

use image::{Rgb, RgbImage};
use laser_profiler::scanner::{
    calibration::CameraCalibration,
    camera::{Camera, DistortedPixel, Distortion},
    laser_plane::LaserPlane,
};
use nalgebra::{Isometry3, Point2, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// Rays a side of a pixel.
const FINE: u32 = 3;
/// Standard deviation of the laser's light across its plane, metres.
const LASER_SIGMA_M: f64 = 0.0008;

/// The camera of all pictures: a lens that bends by several pixels in the corners.
pub(super) fn camera() -> Camera {
    Camera {
        width_px: 480,
        height_px: 360,
        fx_px: 520.0,
        fy_px: 518.0,
        cx_px: 236.0,
        cy_px: 184.0,
        distortion: Distortion::PlumbBob { k1: -0.12, k2: 0.08, p1: 0.001, p2: -0.0005, k3: 0.0 },
        tilt_rad: [0.0; 2],
    }
}

/// Middle and turns, degrees, of boards in all parts of the image, tilted each way.
pub(super) const VIEWS: [[[f64; 3]; 2]; 12] = [
    [[0.0, 0.0, 0.45], [0.0, 0.0, 0.0]],
    [[-0.06, -0.04, 0.45], [25.0, 0.0, 5.0]],
    [[0.06, -0.04, 0.45], [-25.0, 5.0, -5.0]],
    [[-0.06, 0.04, 0.45], [0.0, 28.0, 3.0]],
    [[0.06, 0.04, 0.45], [3.0, -28.0, 0.0]],
    [[0.0, 0.03, 0.42], [20.0, 20.0, 10.0]],
    [[0.0, -0.03, 0.42], [-20.0, 22.0, -10.0]],
    [[0.05, 0.0, 0.5], [22.0, -20.0, 20.0]],
    [[-0.05, 0.0, 0.5], [-22.0, -20.0, -20.0]],
    [[-0.09, 0.06, 0.55], [-30.0, 8.0, 2.0]],
    [[0.09, -0.06, 0.55], [30.0, -8.0, -2.0]],
    [[0.08, 0.06, 0.5], [10.0, 30.0, 0.0]],
];

/// Writes the calibration of a camera alone.
pub(super) fn save_camera(camera: Camera, file: &Path) {
    let calibration = CameraCalibration {
        camera_name: "rendered".to_owned(),
        camera,
        quality: None,
        calibrated_at: None,
    };
    std::fs::write(file, calibration.to_yaml()).unwrap();
}

/// The laser of all pictures: a steep plane half a metre before the camera.
pub(super) fn laser() -> LaserPlane {
    let normal = Unit::new_normalize(Vector3::new(0.9, -0.1, 0.42));
    LaserPlane { normal, distance_m: 0.21 }
}

/// A sheet that reflects, in its own coordinates, metres.
pub(super) trait Surface {
    /// Share of the light that comes back, 0 to 1; `None` beyond its edge.
    fn albedo(&self, x: f64, y: f64) -> Option<f64>;

    /// Its z: 0 for a flat sheet.
    fn height_m(&self, _x: f64, _y: f64) -> f64 {
        0.0
    }
}

/// Checkerboard with inner corners from (0, 0) on, one square beyond them and a white border of half a square.
#[derive(Clone, Copy)]
pub(super) struct Checkerboard {
    /// Inner corners along x.
    pub(super) columns: u32,
    /// Inner corners along y.
    pub(super) rows: u32,
    /// Side of a square, metres.
    pub(super) square_m: f64,
}

impl Surface for Checkerboard {
    fn albedo(&self, x: f64, y: f64) -> Option<f64> {
        let (column, row) = ((x / self.square_m).floor(), (y / self.square_m).floor());
        let is_square = |at: f64, corners: u32| (-1.0..f64::from(corners)).contains(&at);
        if is_square(column, self.columns) && is_square(row, self.rows) {
            return Some(if (column + row).rem_euclid(2.0) < 0.5 { 0.08 } else { 0.85 });
        }
        let reach = |at: f64, corners: u32| {
            (-1.5..f64::from(corners) + 0.5).contains(&(at / self.square_m))
        };
        (reach(x, self.columns) && reach(y, self.rows)).then_some(0.85)
    }
}

/// A checkerboard of fields that are not square, or on a sheet that is not flat.
#[derive(Clone, Copy)]
pub(super) struct Warped {
    pub(super) board: Checkerboard,
    /// Height of a field divided by its width.
    pub(super) ratio: f64,
    /// `z = a x² + b x y + c y²` about the middle: a, b and c, 1/m.
    pub(super) bend_per_m: [f64; 3],
}

impl Surface for Warped {
    fn albedo(&self, x: f64, y: f64) -> Option<f64> {
        self.board.albedo(x, y / self.ratio)
    }

    fn height_m(&self, x: f64, y: f64) -> f64 {
        let Checkerboard { columns, rows, square_m } = self.board;
        let half = |corners: u32| f64::from(corners - 1) * square_m / 2.0;
        let (x, y) = (x - half(columns), y - self.ratio * half(rows));
        let [a, b, c] = self.bend_per_m;
        a * x * x + b * x * y + c * y * y
    }
}

/// A camera with its rays, computed once.
pub(super) struct Renderer {
    camera: Camera,
    rays: Vec<Vector3<f64>>,
}

impl Renderer {
    pub(super) fn new() -> Self {
        Self::of(camera())
    }

    pub(super) fn of(camera: Camera) -> Self {
        let mut rays = Vec::new();
        for v in 0..camera.height_px * FINE {
            for u in 0..camera.width_px * FINE {
                let fine = |at: u32| (f64::from(at) + 0.5) / f64::from(FINE) - 0.5;
                let pixel = DistortedPixel(Point2::new(fine(u), fine(v)));
                rays.push(camera.ray(pixel).unwrap());
            }
        }
        Self { camera, rays }
    }

    /// The surface in white light, and with the green line of `laser` on it.
    pub(super) fn render(
        &self,
        surface: &dyn Surface,
        camera_from_surface: &Isometry3<f64>,
        laser: Option<&LaserPlane>,
    ) -> RgbImage {
        let surface_from_camera = camera_from_surface.inverse();
        let lens = surface_from_camera * Point3::origin();
        let width = self.camera.width_px * FINE;
        RgbImage::from_fn(self.camera.width_px, self.camera.height_px, |u, v| {
            let (mut white, mut green) = (0.0, 0.0);
            for fine in 0..FINE * FINE {
                let (x, y) = (u * FINE + fine % FINE, v * FINE + fine / FINE);
                let ray = self.rays[(y * width + x) as usize];
                let on = meet(surface, &lens, &(surface_from_camera * ray));
                let Some(albedo) = surface.albedo(on.x, on.y) else {
                    white += 0.3;
                    continue;
                };
                white += albedo;
                if let Some(laser) = laser {
                    let point = camera_from_surface * on;
                    let off = (laser.normal.dot(&point.coords) - laser.distance_m) / LASER_SIGMA_M;
                    green += (0.3 + 0.7 * albedo) * (-0.5 * off * off).exp();
                }
            }
            let count = f64::from(FINE * FINE);
            let level = |light: f64| (light / count).clamp(0.0, 255.0).round() as u8;
            Rgb([level(170.0 * white), level(170.0 * white + 80.0 * green), level(170.0 * white)])
        })
    }
}

/// Where a ray from the lens meets the surface, all in the surface's frame.
fn meet(surface: &dyn Surface, lens: &Point3<f64>, ray: &Vector3<f64>) -> Point3<f64> {
    let mut height_m = 0.0;
    loop {
        let on = lens + ray * ((height_m - lens.z) / ray.z);
        let found = surface.height_m(on.x, on.y);
        if (found - height_m).abs() < 1e-8 || on.coords.norm() > 1.0 {
            return on;
        }
        height_m = found;
    }
}

/// A board's pose: its middle at a place, turned about x, y and z, degrees.
pub(super) fn pose(
    board: &Checkerboard,
    middle_m: [f64; 3],
    turned_deg: [f64; 3],
) -> Isometry3<f64> {
    let half = |corners: u32| f64::from(corners - 1) * board.square_m / 2.0;
    pose_of([half(board.columns), half(board.rows)], middle_m, turned_deg)
}

/// The pose of a surface: its point `middle_on_it` at a place, turned about x, y and z, degrees.
pub(super) fn pose_of(
    middle_on_it: [f64; 2],
    middle_m: [f64; 3],
    turned_deg: [f64; 3],
) -> Isometry3<f64> {
    let [x, y, z] = turned_deg.map(f64::to_radians);
    let rotation = UnitQuaternion::from_euler_angles(x, y, z);
    let middle = Vector3::new(middle_on_it[0], middle_on_it[1], 0.0);
    let shift = Vector3::from(middle_m) - rotation * middle;
    Isometry3::from_parts(Translation3::from(shift), rotation)
}

/// A picture out of focus and with noise of a standard deviation of some grey levels.
pub(super) fn blurred(picture: &RgbImage, sigma_px: f32, noise: f64, seed: u64) -> RgbImage {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, noise).unwrap();
    let mut picture = image::imageops::blur(picture, sigma_px);
    for Rgb(pixel) in picture.pixels_mut() {
        let more = noise.sample(&mut random);
        *pixel = pixel.map(|level| (f64::from(level) + more).clamp(0.0, 255.0).round() as u8);
    }
    picture
}

/// Writes a picture.
pub(super) fn save(picture: &RgbImage, directory: &Path, name: &str) {
    picture.save(directory.join(name)).unwrap();
}
