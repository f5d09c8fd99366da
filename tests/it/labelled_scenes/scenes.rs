//! The scenes: levels, widths and noise as real cameras show them.

use laser_profiler::{
    scanner::params::StripeDirection,
    simulate::{exposure::CrossSection, texture::mottle},
};
use libm::{cos, exp, fabs, floor, hypot, sin};

use super::render::{Colour, Lit, Scene};

#[expect(clippy::unnecessary_wraps, reason = "a stripe's function returns it")]
fn lit(center_px: f64, amplitude: f64, sigma_px: f64, surface: &'static str) -> Option<Lit> {
    Some(Lit { section: CrossSection { center_px, amplitude, sigma_px }, surface })
}

fn is_within(at: f64, from: f64, to: f64) -> bool {
    (from..to).contains(&at)
}

/// A quiet black scene, to begin with.
fn dark(name: &'static str, seed: u64) -> Scene {
    Scene {
        name,
        direction: StripeDirection::Horizontal,
        colours: vec![Colour { background: Box::new(|_| 6.0), laser: 1.0 }],
        stripe: Vec::new(),
        stray: Vec::new(),
        reflectance: Box::new(|_| 1.0),
        speckle: (0.08, 1.5),
        read_noise: 1.5,
        shot_gain: 0.02,
        jpeg_quality: None,
        seed,
    }
}

fn gray(background: impl Fn([u32; 2]) -> f64 + 'static) -> Vec<Colour> {
    vec![Colour { background: Box::new(background), laser: 1.0 }]
}

/// All of them.
pub(crate) fn all() -> Vec<Scene> {
    vec![
        bright_ambient(),
        noisy_floor(),
        halo_and_wall(),
        checkerboard(),
        speckle(),
        gaps(),
        steep(),
        reflection(),
        red_on_colours(),
    ]
}

/// A disk with dark markers before a bright rough wall, a sheet of paper below; a thin, faint line on all of them.
fn bright_ambient() -> Scene {
    let is_disk = |[x, y]: [f64; 2]| hypot((x - 175.0) / 110.0, (y - 190.0) / 42.0) < 1.0;
    let is_marker = |[x, y]: [f64; 2]| {
        [[120.0, 190.0], [170.0, 158.0], [235.0, 182.0], [185.0, 216.0]]
            .iter()
            .any(|[cx, cy]| fabs(x - cx) < 13.0 && fabs(y - cy) < 7.0)
    };
    let is_paper = |[x, y]: [f64; 2]| is_within(x, 120.0, 245.0) && y > 220.0;
    let background = move |pixel: [u32; 2]| {
        let at = pixel.map(f64::from);
        if is_marker(at) {
            return 28.0;
        }
        if is_disk(at) {
            return 152.0 + 4.0 * mottle(2, 30.0, pixel);
        }
        if is_paper(at) {
            return 206.0 + 3.0 * mottle(2, 30.0, pixel);
        }
        if at[1] > 205.0 {
            return 40.0 + 10.0 * mottle(3, 12.0, pixel);
        }
        146.0 - 0.03 * at[0] + 9.0 * mottle(1, 3.5, pixel) + 6.0 * mottle(4, 9.0, pixel)
    };
    Scene {
        direction: StripeDirection::Vertical,
        colours: gray(background),
        stripe: vec![Box::new(move |line| {
            let row = f64::from(line);
            // The disk hides the rest of the wall.
            let center_px = 131.0 + 0.93 * (row - 150.0);
            if row < 190.0 && !is_disk([center_px, row]) {
                return lit(131.3 - 0.004 * row, 105.0, 0.85, "wall");
            }
            if is_marker([center_px, row]) {
                return None;
            }
            if is_disk([center_px, row]) {
                return lit(center_px, 70.0, 1.0, "disk");
            }
            // Behind the disk's rim lies a sheet of paper, lower than the disk.
            lit(198.0 - 0.1 * (row - 230.0), 42.0, 1.0, "paper")
        })],
        speckle: (0.15, 1.0),
        read_noise: 2.2,
        jpeg_quality: Some(88),
        ..dark("bright_ambient", 41)
    }
}

/// A floor of coarse grain under a very noisy sensor: two blocks and the shadows behind them.
fn noisy_floor() -> Scene {
    let is_block = |[x, y]: [f64; 2]| {
        (is_within(x, 75.0, 107.0) && is_within(y, 70.0, 165.0))
            || (is_within(x, 190.0, 216.0) && is_within(y, 78.0, 172.0))
    };
    let background = move |pixel: [u32; 2]| {
        let at = pixel.map(f64::from);
        let (level, grain) = if is_block(at) { (150.0, 6.0) } else { (118.0, 22.0) };
        let speck = if !is_block(at) && mottle(13, 1.3, pixel) > 0.55 { -45.0 } else { 0.0 };
        let far = if at[1] < 22.0 && is_within(at[0], 210.0, 290.0) { -70.0 } else { 0.0 };
        level + speck + far + grain * mottle(5, 1.2, pixel) + 8.0 * mottle(6, 25.0, pixel)
    };
    Scene {
        colours: gray(background),
        stripe: vec![Box::new(|line| {
            let column = f64::from(line);
            let floor_px = 129.0 + 0.028 * column;
            match column {
                x if is_within(x, 76.0, 95.0) => lit(104.5 + 0.05 * (x - 76.0), 84.0, 1.7, "block"),
                x if is_within(x, 95.0, 106.0) => lit(105.5 + 2.4 * (x - 95.0), 80.0, 1.9, "block"),
                x if is_within(x, 191.0, 215.0) => lit(107.2, 84.0, 1.7, "block"),
                x if is_within(x, 70.0, 76.0) || is_within(x, 158.0, 191.0) => None,
                x if is_within(x, 215.0, 219.0) => None,
                _ => lit(floor_px, 82.0, 1.7, "floor"),
            }
        })],
        speckle: (0.12, 1.5),
        read_noise: 6.0,
        jpeg_quality: Some(72),
        ..dark("noisy_floor", 42)
    }
}

/// A saturated line with a wide halo on an object, and the thin line on the wall behind it.
fn halo_and_wall() -> Scene {
    let object_px = |row: f64| 168.0 + 22.0 * sin((row - 95.0) / 38.0) + 0.12 * (row - 95.0);
    let is_object = |row: f64| is_within(row, 95.0, 222.0);
    let wall = |line: u32, amplitude: f64, sigma_px: f64| {
        let row = f64::from(line);
        // Half hidden by the object: both are seen for some rows.
        let section = CrossSection { center_px: 128.6 + 0.006 * row, amplitude, sigma_px };
        (row < 118.0).then_some(section)
    };
    let object = move |line: u32, amplitude: f64, sigma_px: f64| {
        let row = f64::from(line);
        is_object(row).then(|| CrossSection { center_px: object_px(row), amplitude, sigma_px })
    };
    let background = move |pixel: [u32; 2]| {
        let at = pixel.map(f64::from);
        let near = if is_object(at[1]) && is_within(at[0], 110.0, 240.0) { 26.0 } else { 0.0 };
        44.0 + near + 5.0 * mottle(7, 3.0, pixel) + 5.0 * mottle(8, 10.0, pixel)
    };
    Scene {
        direction: StripeDirection::Vertical,
        colours: gray(background),
        stripe: vec![
            Box::new(move |line| {
                object(line, 260.0, 1.7).map(|section| Lit { section, surface: "object" })
            }),
            Box::new(move |line| {
                wall(line, 215.0, 1.2).map(|section| Lit { section, surface: "wall" })
            }),
        ],
        stray: vec![
            // Glossy below: there the halo is nearly as bright as full scale.
            Box::new(move |line| {
                object(line, 90.0 + 85.0 * (f64::from(line) / 40.0 - 3.6).clamp(0.0, 1.0), 10.0)
            }),
            Box::new(move |line| wall(line, 38.0, 6.0)),
        ],
        speckle: (0.2, 1.2),
        read_noise: 1.8,
        jpeg_quality: Some(88),
        ..dark("halo_and_wall", 43)
    }
}

/// A slightly rotated checkerboard under a faint line, which is invisible on black squares.
fn checkerboard() -> Scene {
    let square = |[x, y]: [f64; 2]| {
        let (u, v) = (x * cos(0.07) + y * sin(0.07), y * cos(0.07) - x * sin(0.07));
        let is_board = is_within(u, 40.0, 290.0) && is_within(v, 5.0, 205.0);
        let is_pattern = is_within(u, 68.0, 264.0) && is_within(v, 30.0, 180.0);
        let is_odd = floor(u / 28.0) as i32 + floor((v - 2.0) / 28.0) as i32;
        match (is_board, is_pattern && is_odd % 2 != 0) {
            (false, _) => None,
            (true, is_black) => Some(!is_black),
        }
    };
    Scene {
        direction: StripeDirection::Vertical,
        colours: gray(move |pixel| {
            let level = match square(pixel.map(f64::from)) {
                None => 14.0,
                Some(true) => 172.0,
                Some(false) => 24.0,
            };
            level + 4.0 * mottle(9, 40.0, pixel)
        }),
        stripe: vec![Box::new(move |line| {
            let row = f64::from(line);
            let center_px = 118.0 + 0.17 * row;
            square([center_px, row]).filter(|&is_white| is_white)?;
            lit(center_px, 72.0, 1.0, "white")
        })],
        reflectance: Box::new(move |pixel| match square(pixel.map(f64::from)) {
            None => 0.0,
            Some(true) => 1.0,
            Some(false) => 0.08,
        }),
        read_noise: 1.2,
        jpeg_quality: Some(90),
        ..dark("checkerboard", 44)
    }
}

/// Coarse speckle: a saturated core that comes and goes.
fn speckle() -> Scene {
    Scene {
        stripe: vec![Box::new(|line| {
            let column = f64::from(line);
            lit(120.0 + 18.0 * sin(column / 70.0), 330.0, 2.3, "part")
        })],
        reflectance: Box::new(|pixel| (1.0 + 0.6 * mottle(10, 1.6, pixel)).max(0.0)),
        speckle: (0.35, 1.0),
        ..dark("speckle", 45)
    }
}

/// Steps, gaps and pieces of some columns only.
fn gaps() -> Scene {
    Scene {
        stripe: vec![Box::new(|line| {
            let pieces = [
                (4, 60, 150.0),
                (60, 92, 108.3),
                (104, 130, 110.1),
                (130, 141, 168.4),
                (148, 160, 166.0),
                (176, 240, 90.2),
                (240, 250, 83.2),
                (250, 262, 90.4),
                (281, 316, 140.7),
            ];
            let piece = pieces.iter().find(|(from, to, _)| (*from..*to).contains(&line))?;
            lit(piece.2 + 0.02 * f64::from(line), 140.0, 1.5, "part")
        })],
        read_noise: 3.0,
        ..dark("gaps", 46)
    }
}

/// Slopes up to 70 degrees; across a column the stripe is 1/cos as wide.
fn steep() -> Scene {
    Scene {
        stripe: vec![Box::new(|line| {
            let column = f64::from(line);
            let slope = 2.75 * sin(column / 22.0);
            let center_px = 120.0 - 2.75 * 22.0 * (cos(column / 22.0) - 1.0) - 60.0;
            lit(center_px, 160.0, 1.4 * hypot(1.0, slope), "part")
        })],
        read_noise: 2.0,
        ..dark("steep", 47)
    }
}

/// A reflection that crosses the line and is brighter than it here and there.
fn reflection() -> Scene {
    Scene {
        stripe: vec![Box::new(|line| {
            let column = f64::from(line);
            lit(110.0 + 9.0 * sin(column / 90.0), 130.0, 1.8, "part")
        })],
        stray: vec![
            Box::new(|line| {
                let column = f64::from(line);
                let bright = 95.0 + 130.0 * exp(-0.5 * ((column - 210.0) / 18.0).powi(2));
                let center_px = 176.0 - 0.42 * column;
                is_within(column, 40.0, 290.0).then_some(CrossSection {
                    center_px,
                    amplitude: bright,
                    sigma_px: 2.4,
                })
            }),
            Box::new(|line| {
                let column = f64::from(line);
                let center_px = 190.0 + 3.0 * sin(column / 20.0);
                is_within(column, 90.0, 150.0).then_some(CrossSection {
                    center_px,
                    amplitude: 210.0,
                    sigma_px: 1.3,
                })
            }),
        ],
        read_noise: 2.0,
        ..dark("reflection", 48)
    }
}

/// A red laser on patches of every colour, in daylight.
fn red_on_colours() -> Scene {
    const PATCHES: [[f64; 3]; 5] = [
        [168.0, 120.0, 62.0],
        [62.0, 132.0, 66.0],
        [150.0, 152.0, 148.0],
        [48.0, 66.0, 158.0],
        [176.0, 60.0, 52.0],
    ];
    let colour = |index: usize, laser: f64| Colour {
        background: Box::new(move |pixel| {
            let patch = PATCHES[(pixel[0] / 64) as usize % PATCHES.len()];
            patch[index] + 8.0 * mottle(11, 4.0, pixel) + 5.0 * mottle(12, 30.0, pixel)
        }),
        laser,
    };
    Scene {
        colours: vec![colour(0, 1.0), colour(1, 0.14), colour(2, 0.10)],
        stripe: vec![Box::new(|line| {
            let column = f64::from(line);
            let is_step = is_within(column, 128.0, 192.0);
            lit(if is_step { 92.0 } else { 118.0 } + 0.015 * column, 75.0, 1.6, "ground")
        })],
        speckle: (0.12, 1.2),
        read_noise: 3.0,
        jpeg_quality: Some(90),
        ..dark("red_on_colours", 49)
    }
}
