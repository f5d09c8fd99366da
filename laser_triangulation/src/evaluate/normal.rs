//! The standard normal distribution.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Returns φ, the density at `x`.
pub(crate) fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / TAU.sqrt()
}

/// Returns the probability between `from` and `to`. It stays accurate if both lie far out on the same side. Infinite
/// ends are allowed.
pub(crate) fn share_between(from: f64, to: f64) -> f64 {
    // Subtracts small tails, not numbers near one.
    let tail = |x: f64| 0.5 * libm::erfc(x * FRAC_1_SQRT_2);
    if from > 0.0 { tail(from) - tail(to) } else { tail(-to) - tail(-from) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_match_the_tables() {
        for (from, to, share) in [
            (-1.0, 1.0, 0.682_689_492),
            (-2.0, 2.0, 0.954_499_736),
            (f64::NEG_INFINITY, 0.0, 0.5),
            (3.0, f64::INFINITY, 1.349_898e-3),
            (6.0, 7.0, 9.853_e-10),
        ] {
            let found = share_between(from, to);
            assert!((found / share - 1.0).abs() < 1e-3, "{from} {to}: {found}");
            assert!((share_between(-to, -from) - found).abs() < 1e-15);
        }
        assert!((density(1.0) - 0.241_970_725).abs() < 1e-9);
    }
}
