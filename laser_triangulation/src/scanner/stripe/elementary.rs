//! Elementary functions without branches or calls, for loops over lanes. They return the same bits on every machine.

/// Limits x to `low`..=`high`; NaN becomes `low`.
#[inline(always)]
#[allow(clippy::manual_clamp, reason = "clamp would keep what is no number")]
pub(super) fn bounded(x: f32, low: f32, high: f32) -> f32 {
    let x = if x > low { x } else { low };
    if x < high { x } else { high }
}

/// Returns √(a² + b²) by operations whose bits are the same on every machine, unlike `hypot`.
#[inline(always)]
pub(super) fn in_quadrature(a: f32, b: f32) -> f32 {
    let square = a * a + b * b;
    square.sqrt()
}

/// Returns eˣ for x ≤ 0 with a relative error of 3·10⁻⁷; below -87 it returns e⁻⁸⁷.
///
/// x = n ln 2 + r, |r| ≤ ln 2 / 2: the Taylor series to r⁶, with n placed into the exponent's bits.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    // Adding 1.5 · 2²³ rounds to an integer, which ends up in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = if x > -87.0 { x } else { -87.0 };
    let rounded = x * std::f32::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let series = 1.0
        + r * (1.0
            + r * (0.5
                + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    let power = f32::from_bits((rounded.to_bits() << 23).wrapping_add(0x3f80_0000));
    series * power
}

/// Returns the hazard λ(z) = φ(z) / Φ(-z) of a standard normal distribution: the rate at which ln Φ(-z) falls with z.
///
/// For z ≥ 0, λ(z) - z is approximated by a fitted ratio of polynomials, relative error 4·10⁻⁶. For z < 0, Φ(-z) = 1 -
/// Φ(z) reduces it to that case. One division serves both. Beyond ±10⁶ the value is held constant.
#[inline(always)]
pub(super) fn hazard(z: f32) -> f32 {
    let a = bounded(z.abs(), 0.0, 1e6);
    let over = 40.540_234 + a * (24.854_07 + a * (7.247_615 + a));
    let under = 50.809_81 + a * (54.284_92 + a * (26.892_504 + a * (7.246_966_4 + a)));
    let above = a * under + over;
    // λ(a) = above / under, and λ(-a) = φ λ(a) / (λ(a) - φ).
    let density = 0.398_942_3 * exp(-0.5 * a * a);
    let is_below = z < 0.0;
    let numerator = if is_below { density * above } else { above };
    numerator / if is_below { above - density * under } else { under }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_what_they_say() {
        for step in 0..200_000 {
            let x = -f64::from(step) * 86.9 / 200_000.0;
            let x32 = x as f32;
            let (expected, got) = (libm::exp(f64::from(x32)), f64::from(exp(x32)));
            assert!((got / expected - 1.0).abs() < 3e-7, "exp({x})");
        }
        assert!(exp(f32::NEG_INFINITY) > 0.0 && exp(f32::NEG_INFINITY) < 1e-37);
        for step in -12_000..12_000 {
            let z = (f64::from(step) / 1000.0) as f32;
            let at = f64::from(z);
            let above = 0.5 * libm::erfc(at * std::f64::consts::FRAC_1_SQRT_2);
            let expected = libm::exp(-0.5 * at * at) / std::f64::consts::TAU.sqrt() / above;
            assert!((f64::from(hazard(z)) / expected - 1.0).abs() < 2e-5, "hazard({z})");
        }
        // λ(z) - z → 1/z.
        assert!((hazard(1000.0) - 1000.001).abs() < 1e-3);
        assert!(hazard(-1000.0) >= 0.0);
    }
}
