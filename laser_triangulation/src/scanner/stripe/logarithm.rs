//! The natural logarithm of every lane, in operations that vector units have.

/// ln 2 in two parts. The first has few bits, so that its product with an exponent is exact.
const LN_2_HIGH: f32 = 0.693_359_4;
const LN_2_LOW: f32 = -2.121_944_4e-4;
/// Bits of √½: mantissas range from there to √2.
const ROOT_HALF: u32 = 0x3f35_04f3;

/// Returns ln x for positive, normal x, to 2 units in the last place; ln 1 is exactly 0.
///
/// x = 2ᵉ·m with m from √½ to √2, and ln m = 2·artanh(s), s = (m - 1) / (m + 1): the odd series in s converges fast, as
/// |s| ≤ 0.172.
#[inline(always)]
pub(super) fn ln(x: f32) -> f32 {
    let above = x.to_bits().wrapping_sub(ROOT_HALF);
    let exponent = above as i32 >> 23;
    let mantissa = f32::from_bits((above & 0x007f_ffff).wrapping_add(ROOT_HALF));
    let e = exponent as f32;
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let q = s * s;
    let series = 1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0)));
    let ln_mantissa = 2.0 * s + 2.0 * s * q * series;
    e * LN_2_HIGH + (ln_mantissa + e * LN_2_LOW)
}

#[cfg(test)]
mod tests {
    use super::ln;

    #[test]
    fn it_is_that_of_the_standard_library() {
        assert_eq!(ln(1.0).to_bits(), 0.0_f32.to_bits());
        for step in 1..200_000_u32 {
            let x = (f64::from(step) * 0.37).powf(1.7) * 1e-6;
            let x = x as f32;
            let exact = f64::from(x).ln();
            let error = (f64::from(ln(x)) - exact).abs();
            assert!(error <= 1.5e-7 * exact.abs().max(0.5), "ln {x}: {} and not {exact}", ln(x));
        }
    }
}
