//! The grid of hard scenes: each kind of difficulty over its range, and several together.

use super::{Class, Glow, Halo, HardScene, Second, Texture};
use crate::{scanner::params::StripeDirection, simulate::texture::mottle};

/// Every scene of this distance in the grid is vertical.
const VERTICAL_EVERY: u32 = 4;
/// Scenes with several difficulties together.
const NUM_MIXED: u32 = 48;
/// A line of this light is bright and not clipped, for infinitely small pixels.
const BRIGHT: f64 = 0.7;

/// A line without anything beside it.
const PLAIN: HardScene = HardScene {
    seed: 0,
    number: 0,
    class: Class::Line,
    direction: StripeDirection::Horizontal,
    saturation: BRIGHT,
    sigma_px: 2.0,
    glow: None,
    halo: None,
    second: None,
    texture: None,
};

/// Returns all scenes; the same in every call with the same seed. Another seed gives the lines other shapes and noise, and
/// draws other mixtures.
#[must_use]
pub fn grid(seed: u32) -> Vec<HardScene> {
    let mut scenes: Vec<HardScene> = Vec::new();
    scenes.extend(
        [0.3, BRIGHT, 1.0, 2.0, 5.0, 10.0].map(|saturation| HardScene { saturation, ..PLAIN }),
    );
    scenes.extend(glows());
    scenes.extend(halos());
    scenes.extend(second_lines());
    scenes.extend(textures());
    scenes.extend((0..NUM_MIXED).map(|number| mixed(seed, number)));
    for (number, scene) in (0..).zip(&mut scenes) {
        scene.number = number;
        scene.seed = 1000 * seed + number;
        if number % VERTICAL_EVERY == VERTICAL_EVERY - 1 {
            scene.direction = StripeDirection::Vertical;
        }
        // Both sides of the line are the same difficulty, but not to every selection.
        if number % 2 == 1 {
            mirror(scene);
        }
    }
    scenes
}

fn mirror(scene: &mut HardScene) {
    if let Some(glow) = &mut scene.glow {
        glow.distance_px = -glow.distance_px;
    }
    if let Some(halo) = &mut scene.halo {
        halo.length_px = -halo.length_px;
    }
    if let Some(second) = &mut scene.second {
        second.distance_px = -second.distance_px;
    }
}

fn glows() -> Vec<HardScene> {
    let mut scenes = Vec::new();
    for share in [0.1, 0.33, 0.6, 1.0] {
        for sigma_px in [10.0, 17.0, 25.0] {
            for distance_px in [2.0, 8.0, 20.0, 35.0, 60.0] {
                let glow = Some(Glow { share, sigma_px, distance_px });
                scenes.push(HardScene { class: Class::Glow, saturation: 0.6, glow, ..PLAIN });
            }
        }
    }
    for saturation in [1.0, 3.0, 10.0] {
        for share in [0.33, 1.0] {
            for sigma_px in [10.0, 25.0] {
                for distance_px in [5.0, 20.0, 60.0] {
                    let glow = Some(Glow { share, sigma_px, distance_px });
                    scenes.push(HardScene {
                        class: Class::SaturatedGlow,
                        saturation,
                        glow,
                        ..PLAIN
                    });
                }
            }
        }
    }
    scenes
}

fn halos() -> Vec<HardScene> {
    let mut scenes = Vec::new();
    for saturation in [1.5, 3.5, 10.0] {
        for share in [0.2, 0.5, 1.0] {
            for length_px in [4.0, 8.0, 16.0] {
                let halo = Some(Halo { share, length_px });
                scenes.push(HardScene { class: Class::Halo, saturation, halo, ..PLAIN });
            }
        }
    }
    scenes
}

fn second_lines() -> Vec<HardScene> {
    let mut scenes = Vec::new();
    for saturation in [BRIGHT, 4.0] {
        for share in [1.0, 0.6, 0.3] {
            for distance_px in [3.0, 5.0, 7.0, 9.0, 12.0, 18.0, 40.0] {
                let second = Some(Second { share, distance_px });
                scenes.push(HardScene { class: Class::SecondLine, saturation, second, ..PLAIN });
            }
        }
    }
    scenes
}

fn textures() -> Vec<HardScene> {
    let speckle = [(0.2, 1.0), (0.5, 1.0), (0.5, 2.5), (1.0, 1.0), (1.0, 2.5)]
        .map(|(contrast, grain_px)| Texture::Speckle { contrast, grain_px });
    let patches = [(0.5, 3.0), (0.9, 3.0), (0.9, 12.0), (0.9, 40.0)]
        .map(|(depth, size_px)| Texture::Patches { depth, size_px });
    let textures = speckle.into_iter().chain(patches).map(Some);
    let scene = |texture| {
        [0.4, 1.0, 4.0].map(|saturation| HardScene {
            class: Class::Texture,
            saturation,
            texture,
            ..PLAIN
        })
    };
    textures.flat_map(scene).collect()
}

/// Everything at once, each value drawn for the scene.
fn mixed(seed: u32, number: u32) -> HardScene {
    let drawn = |quantity: u32| 0.5 + 0.5 * mottle(13 + u64::from(seed), 1.0, [number, quantity]);
    let between = |quantity: u32, low: f64, high: f64| low + (high - low) * drawn(quantity);
    let geometric = |quantity: u32, low: f64, high: f64| low * (high / low).powf(drawn(quantity));
    let glow = Glow {
        share: geometric(1, 0.1, 1.0),
        sigma_px: between(2, 10.0, 25.0),
        distance_px: geometric(3, 2.0, 60.0),
    };
    let halo = Halo { share: between(5, 0.1, 1.0), length_px: geometric(6, 3.0, 16.0) };
    let second = Second { share: geometric(8, 0.2, 1.0), distance_px: -geometric(9, 3.0, 45.0) };
    let speckle =
        Texture::Speckle { contrast: between(11, 0.1, 0.8), grain_px: between(12, 0.7, 2.0) };
    let patches =
        Texture::Patches { depth: between(11, 0.2, 0.9), size_px: geometric(12, 2.0, 40.0) };
    HardScene {
        class: Class::Mixed,
        saturation: geometric(13, 1.0, 10.0),
        sigma_px: between(14, 1.2, 3.5),
        glow: (drawn(0) < 0.7).then_some(glow),
        halo: (drawn(4) < 0.5).then_some(halo),
        second: (drawn(7) < 0.5).then_some(second),
        texture: Some(if drawn(10) < 0.5 { speckle } else { patches }),
        ..PLAIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_covers_its_ranges_in_both_directions() {
        let scenes = grid(0);
        assert_eq!(scenes, grid(0));
        assert_ne!(scenes, grid(1));
        assert!(scenes.len() >= 200, "{}", scenes.len());
        for class in Class::NAMES.iter().filter_map(|name| Class::from_name(name)) {
            let of_class = scenes.iter().filter(|scene| scene.class == class);
            let vertical =
                of_class.clone().filter(|scene| scene.direction == StripeDirection::Vertical);
            assert!(of_class.count() >= 6 && vertical.count() >= 1, "{class:?}");
        }
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
                (low.min(value), high.max(value))
            })
        };
        let glows = || scenes.iter().filter_map(|scene| scene.glow);
        assert_eq!(range(&mut glows().map(|glow| glow.share)), (0.1, 1.0));
        assert_eq!(range(&mut glows().map(|glow| glow.sigma_px)), (10.0, 25.0));
        assert_eq!(range(&mut glows().map(|glow| glow.distance_px.abs())), (2.0, 60.0));
        assert_eq!(range(&mut scenes.iter().map(|scene| scene.saturation)), (0.3, 10.0));
    }
}
