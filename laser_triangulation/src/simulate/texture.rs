//! Uneven surfaces: mottled walls, grainy floors.

/// Returns the unevenness of a surface at a pixel (column, row), from -1 to 1, about 0 on average: random values on a
/// grid of cells of `size_px`, with bilinear interpolation. A function of its arguments alone.
pub fn mottle(seed: u64, size_px: f64, [column, row]: [u32; 2]) -> f64 {
    let at = [column, row].map(|pixel| f64::from(pixel) / size_px);
    let cell = at.map(|place| place.floor() as u64);
    let share = at.map(|place| place - place.floor());
    let corner = |dx: u64, dy: u64| value(seed, cell[0] + dx, cell[1] + dy);
    let between = |a: f64, b: f64, share: f64| a + share * (b - a);
    let top = between(corner(0, 0), corner(1, 0), share[0]);
    let bottom = between(corner(0, 1), corner(1, 1), share[0]);
    between(top, bottom, share[1])
}

/// Returns a pseudo-random value from -1 to 1: `SplitMix64` of the seed and the position.
fn value(seed: u64, column: u64, row: u64) -> f64 {
    let mix = |state: u64| {
        let state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^ (state >> 31)
    };
    let bits = mix(mix(mix(seed) ^ column) ^ row) >> 11;
    bits as f64 / f64::from(1_u32 << 26) / f64::from(1_u32 << 26) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_of_one_pixel_are_uniform_and_independent() {
        let values: Vec<f64> = (0..40_000).map(|at| mottle(3, 1.0, [at % 200, at / 200])).collect();
        let mean =
            |product: &dyn Fn(usize) -> f64| (0..39_000).map(product).sum::<f64>() / 39_000.0;
        assert!(values.iter().all(|value| (-1.0..=1.0).contains(value)));
        assert!(mean(&|at| values[at]).abs() < 0.015);
        assert!((mean(&|at| values[at] * values[at]) - 1.0 / 3.0).abs() < 0.01);
        for lag in [1, 200] {
            assert!(mean(&|at| values[at] * values[at + lag]).abs() < 0.01, "{lag}");
        }
    }

    #[test]
    fn larger_grains_are_smooth() {
        for at in 0..500 {
            let step = mottle(3, 10.0, [at + 1, 7]) - mottle(3, 10.0, [at, 7]);
            assert!(step.abs() <= 0.2 + 1e-12, "{step}");
        }
    }
}
