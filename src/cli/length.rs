//! Lengths, intervals and regions on the command line.

use crate::metrology::surface::Region;

/// Parses a length such as `2.5mm`, `80um`, `0.3m` or a number of metres. Returns metres.
///
/// # Errors
/// Anything else, with valid examples.
pub(super) fn length_m(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6), ("nm", 1e-9), ("cm", 1e-2), ("m", 1.0)];
    let found = units.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)));
    let (number, factor) = found.unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number * factor),
        _ => Err(format!("{text:?} is not a length: write 2.5mm, 80um, 0.3m or 0.0025 (metres)")),
    }
}

/// Parses a length above 0. Returns metres.
///
/// # Errors
/// Not a length, or not above 0.
pub(super) fn positive_m(text: &str) -> Result<f64, String> {
    match length_m(text)? {
        length if length > 0.0 => Ok(length),
        _ => Err(format!("{text:?} must be above 0")),
    }
}

/// Parses a region `x0,y0,x1,y1` with `x0 < x1` and `y0 < y1`.
///
/// # Errors
/// Anything else.
pub(super) fn region(text: &str) -> Result<Region, String> {
    let numbers = text.split(',').map(length_m).collect::<Result<Vec<_>, _>>()?;
    match numbers[..] {
        [x0, y0, x1, y1] if x0 < x1 && y0 < y1 => Ok(Region { from_m: [x0, y0], to_m: [x1, y1] }),
        _ => Err(format!("{text:?} is not a region x0,y0,x1,y1 with x0 < x1 and y0 < y1")),
    }
}

/// Parses an interval `FROM,TO` with `FROM < TO`. Returns metres.
///
/// # Errors
/// Anything else.
pub(super) fn interval_m(text: &str) -> Result<[f64; 2], String> {
    let numbers = text.split(',').map(length_m).collect::<Result<Vec<_>, _>>()?;
    match numbers[..] {
        [from, to] if from < to => Ok([from, to]),
        _ => Err(format!("{text:?} is not FROM,TO with FROM < TO")),
    }
}

/// A length and one standard deviation of it, if given, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UncertainLength {
    pub(super) length_m: f64,
    pub(super) sigma_m: Option<f64>,
}

/// Parses a length with or without its standard deviation: `3.68mm`, `3.68mm±0.002mm`, `3.68mm+-2um`.
///
/// # Errors
/// Not lengths, or a standard deviation below 0.
pub(super) fn uncertain_m(text: &str) -> Result<UncertainLength, String> {
    let parts = ["±", "+/-", "+-"].into_iter().find_map(|sign| text.split_once(sign));
    let Some((length, sigma)) = parts else {
        return Ok(UncertainLength { length_m: length_m(text)?, sigma_m: None });
    };
    match length_m(sigma)? {
        sigma_m if sigma_m >= 0.0 => {
            Ok(UncertainLength { length_m: length_m(length)?, sigma_m: Some(sigma_m) })
        }
        _ => Err(format!("{sigma:?} must be 0 or more: one standard deviation")),
    }
}

/// Parses a length above 0 with or without its standard deviation.
///
/// # Errors
/// As [`uncertain_m`]; a length that is not above 0.
pub(super) fn positive_uncertain_m(text: &str) -> Result<UncertainLength, String> {
    match uncertain_m(text)? {
        length if length.length_m > 0.0 => Ok(length),
        _ => Err(format!("{text:?} must be above 0")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_need_a_known_unit() {
        for (text, metres) in
            [("2.5mm", 2.5e-3), ("80um", 8e-5), ("-3 µm", -3e-6), ("0.3", 0.3), ("1m", 1.0)]
        {
            assert!((length_m(text).unwrap() - metres).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "2 inches", "nan", "1e999"] {
            assert!(length_m(text).unwrap_err().contains("2.5mm"), "{text}");
        }
        assert!(positive_m("0mm").is_err() && positive_m("1mm").is_ok());
    }

    #[test]
    fn a_length_may_have_an_uncertainty() {
        for text in ["3.68mm±0.002mm", "3.68mm+-2um", "3.68mm +/- 2 µm", "0.00368±0.000002"] {
            let UncertainLength { length_m, sigma_m } = uncertain_m(text).unwrap();
            assert!((length_m - 3.68e-3).abs() < 1e-12, "{text}");
            assert!((sigma_m.unwrap() - 2e-6).abs() < 1e-15, "{text}");
        }
        assert_eq!(uncertain_m("1mm").unwrap().sigma_m, None);
        for text in ["1mm±", "±1mm", "1mm±-1um", "1mm±two"] {
            assert!(uncertain_m(text).is_err(), "{text}");
        }
        assert!(positive_uncertain_m("0mm±1um").is_err());
    }

    #[test]
    fn regions_and_intervals_are_parsed() {
        let found = region("-1mm,0,2cm,0.03").unwrap();
        assert!((found.from_m[0] + 1e-3).abs() < 1e-15 && (found.to_m[1] - 0.03).abs() < 1e-15);
        for text in ["0,0,1", "1,0,0,1", "0,0,1,1,1", "a,b,c,d"] {
            assert!(region(text).is_err(), "{text}");
        }
        assert!(interval_m("1mm,2mm").is_ok() && interval_m("2mm,1mm").is_err());
    }
}
