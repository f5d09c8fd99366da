//! Requests of `ros2 param set` and `ros2 param load`, which guess the type of a value from its text.

use super::*;
use crate::ros::table::Kind;

/// A value as rclpy sends it: `ros2 param load` writes each value of a dump as Python does, and reads that as YAML 1.1,
/// where a number with an exponent needs a point. Of an empty list it takes the first type of array.
fn as_rclpy_sends(value: &Value) -> rcl::ParameterValue<'_> {
    let none = rcl::ParameterValue::default;
    match value {
        Value::Float(number) => match python_repr(*number) {
            text if text.contains('e') && !text.contains('.') => rcl::ParameterValue {
                kind: parameter_type::STRING,
                string_value: text.into(),
                ..none()
            },
            _ => convert::value_message(value),
        },
        Value::TextList(texts) if texts.is_empty() => {
            rcl::ParameterValue { kind: parameter_type::BYTE_ARRAY + 1, ..none() }
        }
        other => convert::value_message(other),
    }
}

/// `repr` of a float in Python: an exponent of at least two digits below 1e-4 and from 1e16 on.
fn python_repr(number: f64) -> String {
    if number == 0.0 || (1e-4..1e16).contains(&number.abs()) {
        return format!("{number:?}");
    }
    let text = format!("{number:e}");
    let (digits, exponent) = text.split_once('e').unwrap();
    let (sign, exponent) = exponent.strip_prefix('-').map_or(('+', exponent), |rest| ('-', rest));
    format!("{digits}e{sign}{exponent:0>2}")
}

#[test]
fn the_dump_of_a_node_can_be_loaded_into_it() {
    assert_eq!(python_repr(1e-5), "1e-05");
    assert_eq!(python_repr(2.5e-7), "2.5e-07");
    assert_eq!(python_repr(1e22), "1e+22");
    let mut values = Parameters::default();
    let cameras = Value::TextList(vec!["left".into(), "right".into()]);
    for before in [Parameters::default(), {
        values.set("cameras", cameras, "a test").unwrap();
        values
    }] {
        let node = node(before.clone(), Box::new(|_, _| Ok(())));
        let dumped = before.iter().map(|declared| Parameter {
            name: declared.name().into(),
            value: as_rclpy_sends(declared.value()),
        });
        for (declared, set) in before.iter().zip(node.set(dumped.collect())) {
            assert_eq!(set, (true, String::new()), "{}", declared.name());
        }
        let all = |values: &Parameters| -> Vec<_> {
            values.iter().map(|one| (one.name().to_owned(), one.value().clone())).collect()
        };
        assert_eq!(node.store.read(all), all(&before));
    }
}

#[test]
fn small_numbers_that_arrive_as_text_are_numbers() {
    let node = default_node();
    let mut num_sent = 0;
    for declared in Parameters::default().iter() {
        let Kind::Float { min, max, .. } = declared.row().kind else { continue };
        for number in [1e-5, -1e-5, 3e-6].into_iter().filter(|it| (min..=max).contains(it)) {
            let sent = Value::Float(number);
            let value = as_rclpy_sends(&sent);
            assert_eq!(value.kind, parameter_type::STRING, "{number}");
            let set = node.set(vec![Parameter { name: declared.name().into(), value }]).remove(0);
            // Some numbers contradict another value, which is another reason.
            assert!(set.0 || !set.1.contains("must be a float"), "{}: {}", declared.name(), set.1);
            if set.0 {
                assert_eq!(node.get(declared.name()), Some(sent), "{}", declared.name());
                num_sent += 1;
            }
        }
    }
    assert!(num_sent > 10, "{num_sent}");
    let events = node.events.lock().unwrap();
    let event: ParameterEvent<'_> = cdr::decode(events.last().unwrap()).unwrap();
    assert_eq!(event.changed_parameters[0].value.kind, parameter_type::DOUBLE, "as it is in force");
    drop(events);
    let word = Value::Text("1e-05".into());
    let (is_set, reason) = node.set_atomically(vec![parameter("slice.profiles", &word)]);
    assert!(!is_set && reason.contains("an integer from 1"), "{reason}");
    for word in ["inf", "nan", "0x10"] {
        let word = Value::Text(word.into());
        let (is_set, reason) =
            node.set_atomically(vec![parameter("extraction.segment_threshold", &word)]);
        assert!(!is_set && reason.contains("a float from"), "{reason}");
    }
}
