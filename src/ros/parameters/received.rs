//! Values that peers send with another type than they mean, because their tools guess types from text.

use laser_triangulation::parameters::{Kind, Value};

/// Returns the value that a peer means for a parameter of this kind: `ros2 param set` and `ros2 param load` send the
/// float `1e-05` as a text, because YAML 1.1 reads a number without a point as one.
pub(super) fn meant(kind: Kind, value: Value) -> Value {
    match (kind, value) {
        (Kind::Float { .. }, Value::Text(text)) => {
            decimal(&text).map_or(Value::Text(text), Value::Float)
        }
        (_, value) => value,
    }
}

/// Returns the number that a text is, and nothing else: no spaces, no hexadecimal digits, no infinity, no NaN.
fn decimal(text: &str) -> Option<f64> {
    let is_of_number = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let number = text.bytes().all(is_of_number).then(|| text.parse().ok()).flatten();
    number.filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOAT: Kind = Kind::Float { default: 0.0, min: -1.0, max: 1.0 };

    #[test]
    fn a_text_that_is_a_number_is_meant_as_one() {
        for (text, number) in [
            ("1e-05", 1e-5),
            ("1e-5", 1e-5),
            ("-2E+3", -2e3),
            ("+7", 7.0),
            (".5", 0.5),
            ("1.", 1.0),
        ] {
            assert_eq!(meant(FLOAT, Value::Text(text.into())), Value::Float(number), "{text}");
        }
    }

    #[test]
    fn other_texts_and_other_kinds_stay_as_they_are() {
        let texts = [
            "", " 1e-5", "1e-5 ", "0x10", "inf", "-inf", "nan", "NaN", "infinity", "1e999", "e",
            ".", "1_000", "1,5", "1e", "1e-5m",
        ];
        for text in texts {
            let value = Value::Text(text.to_owned());
            assert_eq!(meant(FLOAT, value.clone()), value, "{text:?}");
        }
        let (text, integer) = (Value::Text("1e-05".into()), Value::Integer(1));
        assert_eq!(meant(Kind::Text { default: "" }, text.clone()), text);
        assert_eq!(meant(Kind::Integer { default: 0, min: 0, max: 9 }, text.clone()), text);
        assert_eq!(meant(FLOAT, integer.clone()), integer, "ROS does not convert integers");
    }
}
