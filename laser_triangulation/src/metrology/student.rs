//! Coverage of small samples.

/// Half widths of the two-sided 95 % interval for 1 to 10 degrees of freedom.
const TABLE: [f64; 10] =
    [12.706_2, 4.302_7, 3.182_4, 2.776_4, 2.570_6, 2.446_9, 2.364_6, 2.306_0, 2.262_2, 2.228_1];
/// Half width of the 95 % interval of the normal distribution, standard deviations.
pub const NORMAL_95: f64 = 1.959_964;

/// Returns the half width of the 95 % interval, in standard deviations estimated with these degrees of freedom: Student's
/// quantile (Abramowitz and Stegun 1964, table 26.10, and their expansion 26.7.5 above 10). Below one degree of
/// freedom the result is infinite.
#[must_use]
pub(crate) fn factor_95(degrees_of_freedom: f64) -> f64 {
    let dof = degrees_of_freedom;
    if dof.is_nan() || dof < 1.0 {
        return f64::INFINITY;
    }
    if dof < 10.0 {
        // Between two entries: linear in 1/dof, in which the quantile is nearly straight.
        let low = dof.floor();
        let (from, to) = (TABLE[low as usize - 1], TABLE[low as usize]);
        let share = (1.0 / low - 1.0 / dof) / (1.0 / low - 1.0 / (low + 1.0));
        return from + share * (to - from);
    }
    let z = NORMAL_95;
    let first = (z.powi(3) + z) / 4.0;
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    z + first / dof + second / dof.powi(2) + third / dof.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_match_the_tables() {
        // Abramowitz and Stegun, table 26.10, column 0.95.
        for (dof, expected) in
            [(1.0, 12.706), (5.0, 2.571), (10.0, 2.228), (20.0, 2.086), (120.0, 1.980)]
        {
            assert!((factor_95(dof) - expected).abs() < 1.5e-3, "{dof}: {}", factor_95(dof));
        }
        assert!(factor_95(0.5).is_infinite() && factor_95(f64::NAN).is_infinite());
        assert!(factor_95(2.5) < factor_95(2.0) && factor_95(2.5) > factor_95(3.0));
    }
}
