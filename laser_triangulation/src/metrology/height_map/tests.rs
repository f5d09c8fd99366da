use super::*;
use crate::metrology::{noise::surface, surface::Surface};

const PITCH_M: [f64; 2] = [1e-4; 2];

fn resample(surface: &Surface, cell_m: f64) -> RegularHeightMap {
    let region = Region { from_m: [-2e-3; 2], to_m: [1.99e-3; 2] };
    let mut resampler = Resampler::new(GridLayout::covering(&region, cell_m).unwrap(), PITCH_M);
    surface.rows().for_each(|row| resampler.push(row));
    resampler.finish()
}

#[test]
fn a_plane_stays_a_plane_at_any_cell() {
    let height = |x: f64, y: f64| 1e-3 + 0.1 * x - 0.2 * y;
    for cell_m in [0.3e-4, 1e-4, 2.5e-4, 8e-4] {
        let map = resample(&surface(height, 0.0, 1, 0), cell_m);
        assert_eq!(map.count(CellState::Measured), map.z_m.len());
        for row in 0..map.layout.height as usize {
            for column in 0..map.layout.width as usize {
                let [x, y] = map.layout.center_m(column, row);
                let z = f64::from(map.z_m[row * map.layout.width as usize + column]);
                assert!((z - height(x, y)).abs() < 2e-9, "{cell_m} {x} {y} {z}");
            }
        }
    }
}

#[test]
fn waves_keep_the_stated_share_of_their_height() {
    for (cell_m, wavelength_m) in [(4e-4, 2e-3), (1e-4, 1e-3), (2e-4, 5e-4)] {
        let tau = std::f64::consts::TAU;
        let map =
            resample(&surface(|x, _| 1e-5 * (tau * x / wavelength_m).sin(), 0.0, 1, 0), cell_m);
        let (mut sine, mut square) = (0.0, 0.0);
        for (at, z) in map.z_m.iter().enumerate() {
            let [x, _] = map.layout.center_m(at % map.layout.width as usize, 0);
            let wave = (tau * x / wavelength_m).sin();
            sine += f64::from(*z) * wave;
            square += wave * wave;
        }
        let sinc = |share: f64| (share * tau / 2.0).sin() / (share * tau / 2.0);
        let expected = sinc(1e-4 / wavelength_m).powi(2) * sinc(cell_m / wavelength_m);
        let kept = sine / square / 1e-5;
        assert!((kept - expected).abs() < 0.03, "{cell_m} {wavelength_m}: {kept} {expected}");
    }
}

#[test]
fn invalid_cells_stay_invalid_unless_filled() {
    let mut holes = surface(|x, _| 0.1 * x, 0.0, 1, 0);
    for point in &mut holes.points {
        if point.x.abs() < 2.2e-4 || (point.y - 1e-3).abs() < 6e-4 {
            *point = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        }
    }
    let mut map = resample(&holes, 1e-4);
    let invalid = map.count(CellState::Invalid);
    let width = map.layout.width as usize;
    assert!(map.z_m[5 * width + 20].is_nan(), "in the middle of the gap along x");
    let filled = fill_gaps(&mut map, 6);
    assert!(filled > 0 && map.count(CellState::Filled) == filled);
    assert_eq!(map.count(CellState::Invalid) + filled, invalid);
    for (at, z) in map.z_m.iter().enumerate().filter(|(_, z)| z.is_finite()) {
        let [x, _] = map.layout.center_m(at % width, 0);
        // Cells at a border hold the mean of their measured part.
        assert!((f64::from(*z) - 0.1 * x).abs() < 3e-6, "{x} {z}");
    }
    assert!(map.z_m[30 * width + 20].is_nan(), "the wide gap along y stays");
}

#[test]
fn a_whole_turn_is_closed() {
    // A disk of 100 radial profiles; the next one after the last is the first.
    let profile = |number: u32| -> Vec<Point3<f64>> {
        let (sin, cos) = (f64::from(number) * std::f64::consts::TAU / 100.0).sin_cos();
        (1..20).map(|i| f64::from(i) * 1e-4).map(|r| Point3::new(r * cos, r * sin, 1e-3)).collect()
    };
    let region = Region { from_m: [-1e-3; 2], to_m: [0.99e-3; 2] };
    let mut resampler = Resampler::new(GridLayout::covering(&region, 1e-4).unwrap(), PITCH_M);
    (0..100).for_each(|number| resampler.push(&profile(number)));
    let map = resampler.finish();
    let seam: Vec<_> = (12..20).map(|column| map.z_m[9 * 20 + column]).collect();
    assert!(seam.iter().all(|z| z.is_finite()), "{seam:?}");
}

#[test]
fn points_far_apart_are_not_joined() {
    let mut apart = surface(|_, _| 0.0, 0.0, 1, 0);
    for point in apart.points.iter_mut().filter(|point| point.x > 0.0) {
        point.x += 1e-3;
    }
    let map = resample(&apart, 1e-4);
    let [first, last] = [20, 29].map(|column| map.z_m[column]);
    assert!(first.is_nan() && last.is_nan(), "no surface between the halves");
}

#[test]
fn grids_are_bounded() {
    let region = Region { from_m: [0.0; 2], to_m: [1.0, 1.0] };
    let error = GridLayout::covering(&region, 1e-6).unwrap_err();
    assert!(matches!(error, GridError::TooLarge { .. }), "{error}");
    assert_eq!(GridLayout::covering(&Region::ALL, 1e-3), Err(GridError::Unbounded));
    let nothing = Surface::default().extent();
    assert_eq!(GridLayout::covering(&nothing, 1e-3), Err(GridError::Empty));
    for cell_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = GridLayout::covering(&region, cell_m).unwrap_err();
        assert!(matches!(error, GridError::Cell { .. }), "{error}");
    }
    let layout = GridLayout::covering(&region, 0.1).unwrap();
    assert_eq!((layout.width, layout.height), (11, 11));
}
