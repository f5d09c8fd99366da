//! One spelling of the names of types.

/// Returns the name of a type as ROS 2 spells it, `sensor_msgs/msg/Image`, from any of the spellings that recorders use:
/// `sensor_msgs/Image` (ROS 1), `sensor_msgs::msg::Image` (IDL), `sensor_msgs::msg::dds_::Image_` (DDS). Any other name
/// stays as it is.
pub(super) fn of_ros_2(name: &str) -> String {
    let parts: Vec<_> = name.split('/').flat_map(|part| part.split("::")).collect();
    let message = match parts.as_slice() {
        [package, kind] | [package, "msg", kind] => Some((package, *kind)),
        [package, "msg", "dds_", kind] => kind.strip_suffix('_').map(|kind| (package, kind)),
        _ => None,
    };
    let is_word = |word: &str| {
        word.starts_with(|first: char| first.is_ascii_alphabetic())
            && word.chars().all(|character| character.is_ascii_alphanumeric() || character == '_')
    };
    match message {
        Some((package, kind)) if is_word(package) && is_word(kind) => {
            format!("{package}/msg/{kind}")
        }
        _ => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_message_gives_the_same_name() {
        for (package, kind) in
            [("sensor_msgs", "Image"), ("nav_msgs", "Odometry"), ("laser_profiler_msgs", "Profile")]
        {
            for spelled in [
                format!("{package}/{kind}"),
                format!("{package}/msg/{kind}"),
                format!("{package}::{kind}"),
                format!("{package}::msg::{kind}"),
                format!("{package}::msg::dds_::{kind}_"),
                format!("{package}/msg/dds_/{kind}_"),
            ] {
                assert_eq!(of_ros_2(&spelled), format!("{package}/msg/{kind}"), "{spelled}");
            }
        }
    }

    #[test]
    fn names_that_are_no_message_stay() {
        for name in [
            "",
            "Image",
            "foxglove.CompressedImage",
            "a/srv/B_Request",
            "a::srv::dds_::B_Request_",
            "a/action/B_Goal",
            "a/b/c/d",
            "a//B",
            "a/B C",
        ] {
            assert_eq!(of_ros_2(name), name);
        }
    }
}
