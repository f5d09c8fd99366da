use std::{collections::BTreeMap, fs, path::Path};

use hiroz_schema::{
    FieldDescription, FieldTypeDescription, TypeDescription, TypeDescriptionMsg, calculate_hash,
};
use ros2msg::{Type, parse_message_string};
use serde::Deserialize;

use super::*;
use crate::msg::{
    action_msgs, builtin_interfaces, diagnostic_msgs, foxglove_msgs, geometry_msgs,
    laser_profiler_msgs::{self, scan},
    lifecycle_msgs,
    noise::{self, for_each_message},
    rcl_interfaces, rosgraph_msgs, rosout, sensor_msgs, std_msgs, std_srvs, tf2_msgs,
    unique_identifier_msgs,
};

mod services;

/// Returns the fields of a type, parsed from its text by an independent parser.
fn fields(message: &MessageType) -> Vec<ros2msg::Field> {
    let mut parts = message.name.split('/');
    let (package, name) = (parts.next().unwrap(), parts.next_back().unwrap());
    let parsed = parse_message_string(package, name, message.text).unwrap().fields;
    if !parsed.is_empty() {
        return parsed;
    }
    // rosidl adds a field to empty messages.
    let text = "uint8 structure_needs_at_least_one_member";
    parse_message_string(package, name, text).unwrap().fields
}

/// Returns the full name of the message type of a field; `None` for numbers and text.
fn nested(field: &Type) -> Option<String> {
    let package = field.base_type.pkg_name.as_ref()?;
    Some(format!("{package}/msg/{}", field.base_type.type_name))
}

/// Returns the full name of a part as it is hashed: the parts of an action are no messages of their own.
fn full_name(message: &MessageType, nested: String) -> String {
    let of_action = nested.replace("/msg/", "/action/");
    let is_part = message.dependencies.iter().any(|part| part.name == of_action);
    if is_part { of_action } else { nested }
}

fn description(message: &MessageType) -> TypeDescription {
    let field = |field: &ros2msg::Field| {
        let kind = &field.field_type;
        let base = match kind.base_type.type_name.as_str() {
            _ if nested(kind).is_some() => 1,
            "int8" => 2,
            "uint8" | "char" => 3,
            "int16" => 4,
            "uint16" => 5,
            "int32" => 6,
            "uint32" => 7,
            "int64" => 8,
            "uint64" => 9,
            "float32" => 10,
            "float64" => 11,
            "bool" => 15,
            "byte" => 16,
            "string" => 17,
            other => panic!("{other}"),
        };
        let array = match (kind.is_array, kind.array_size, kind.is_upper_bound) {
            (false, ..) => 0,
            (true, Some(_), false) => 48,
            (true, Some(_), true) => 96,
            (true, None, _) => 144,
        };
        FieldDescription {
            name: field.name.clone(),
            field_type: FieldTypeDescription {
                type_id: base + array,
                capacity: kind.array_size.unwrap_or(0).into(),
                string_capacity: 0,
                nested_type_name: nested(kind)
                    .map_or_else(String::new, |nested| full_name(message, nested)),
            },
            default_value: String::new(),
        }
    };
    TypeDescription {
        type_name: message.name.to_owned(),
        fields: fields(message).iter().map(field).collect(),
    }
}

/// Collects all types within a type, sorted by name.
fn referenced(message: &MessageType, found: &mut BTreeMap<&'static str, TypeDescription>) {
    for dependency in message.dependencies {
        found.insert(dependency.name, description(dependency));
        referenced(dependency, found);
    }
}

fn check_hash<T: Message>() {
    let mut found = BTreeMap::new();
    referenced(T::TYPE, &mut found);
    let description = TypeDescriptionMsg {
        type_description: description(T::TYPE),
        referenced_type_descriptions: found.into_values().collect(),
    };
    assert_eq!(calculate_hash(&description).to_rihs_string(), T::TYPE.hash, "{}", T::TYPE.name);
}

#[test]
fn every_hash_is_that_of_its_text() {
    for_each_message!(check_hash,);
}

#[test]
fn hashes_are_the_published_ones() {
    let published = [
        (
            <sensor_msgs::Image<'_>>::TYPE,
            "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
        ),
        (
            <sensor_msgs::PointCloud2<'_>>::TYPE,
            "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
        ),
        (
            <sensor_msgs::CompressedImage<'_>>::TYPE,
            "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
        ),
        (
            <sensor_msgs::CameraInfo<'_>>::TYPE,
            "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
        ),
        (
            <sensor_msgs::JointState<'_>>::TYPE,
            "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
        ),
        (
            <std_msgs::Header<'_>>::TYPE,
            "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
        ),
        (
            <diagnostic_msgs::DiagnosticArray<'_>>::TYPE,
            "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        ),
        (
            <laser_profiler_msgs::Centerline<'_>>::TYPE,
            "ff3b478f46d354f91382d435d1c00766fa1abf3715ca431834c3b699e60b2090",
        ),
        (
            <laser_profiler_msgs::Profile<'_>>::TYPE,
            "03d0b461f12771f11110d3f5542ab60ed8e75df0224d2171c553ce308dd77e06",
        ),
        (
            <laser_profiler_msgs::SliceInfo<'_>>::TYPE,
            "7aef36e2a4092a794b598b8f578b7010732d796ac352684a1ba7dc339cf804ff",
        ),
        (
            <laser_profiler_msgs::StreamStatus<'_>>::TYPE,
            "355d7da1400ef992c455bce1a45973391bd0b3b4fae8cc5df0b2249fb275efb6",
        ),
        (
            <rosout::Log<'_>>::TYPE,
            "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
        ),
        (
            <rcl_interfaces::ParameterEvent<'_>>::TYPE,
            "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204",
        ),
        (
            <rcl_interfaces::ParameterDescriptor<'_>>::TYPE,
            "52175dbfda6c51153101d33d2a9da05743f66f02d5ab2ca9ec4709b46b73d704",
        ),
        (
            laser_profiler_msgs::FrameTrace::TYPE,
            "8c47b55c0143779382deace35fd0635dcb126dccabc3ce94f3fe0e8ad33d605c",
        ),
    ];
    for (message, hash) in published {
        assert_eq!(message.hash, format!("RIHS01_{hash}"), "{}", message.name);
    }
}

/// Appends the wire layout according to a type's text, in the format of [`noise::layout`].
fn wire(message: &MessageType, path: &str, layout: &mut Vec<String>) {
    for field in fields(message) {
        let kind = &field.field_type;
        let base = kind.base_type.type_name.as_str();
        let path = format!("{path}.{}", field.name);
        let paths = match (kind.is_array, kind.array_size) {
            (true, None) if base == "uint8" => {
                layout.push(format!("{path}: uint8[]"));
                continue;
            }
            (false, _) => vec![path],
            (true, None) => vec![path + "[]"],
            (true, Some(_)) if kind.is_upper_bound => vec![path + "[]"],
            (true, Some(length)) => (0..length).map(|i| format!("{path}[{i}]")).collect(),
        };
        for path in paths {
            match nested(kind) {
                Some(name) => {
                    let name = full_name(message, name);
                    let inner = message.dependencies.iter().find(|message| message.name == name);
                    wire(inner.unwrap_or_else(|| panic!("{path} is {name}")), &path, layout);
                }
                None if base == "byte" => layout.push(format!("{path}: uint8")),
                None => layout.push(format!("{path}: {base}")),
            }
        }
    }
}

fn check_layout<'de, T: Message + Deserialize<'de>>() {
    let mut expected = Vec::new();
    wire(T::TYPE, "", &mut expected);
    assert_eq!(noise::layout::<T>(), expected, "{}", T::TYPE.name);
}

#[test]
fn every_struct_has_the_layout_of_its_text() {
    for_each_message!(check_layout,);
}

fn check_schema<T: Message>() {
    let rule = format!("\n{}\nMSG: ", "=".repeat(80));
    let schema = T::TYPE.schema();
    let mut parts = schema.split(&rule);
    assert_eq!(parts.next(), Some(T::TYPE.text));
    let mut found = BTreeMap::new();
    referenced(T::TYPE, &mut found);
    let mut names: Vec<_> = parts.map(|part| part.split_once('\n').unwrap().0).collect();
    names.sort_unstable();
    let expected: Vec<_> = found.keys().map(|name| name.replace("/msg/", "/")).collect();
    assert_eq!(names, expected, "{}", T::TYPE.name);
}

#[test]
fn every_schema_has_each_dependency_once() {
    for_each_message!(check_schema,);
}

#[test]
fn dependencies_are_in_the_order_of_rosbag2() {
    let schema = <laser_profiler_msgs::Centerline<'_>>::TYPE.schema();
    let names: Vec<_> = schema.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
    // Depth first; by name: laser_profiler_msgs before sensor_msgs before std_msgs.
    assert_eq!(
        names,
        [
            "laser_profiler_msgs/FrameTrace",
            "builtin_interfaces/Time",
            "sensor_msgs/RegionOfInterest",
            "std_msgs/Header",
        ]
    );
}

/// Returns the packages named in the fields of an interface file.
fn packages(text: &str) -> Vec<&str> {
    let kinds = text.lines().filter_map(|line| line.split_whitespace().next());
    kinds
        .filter(|kind| !kind.starts_with('#'))
        .filter_map(|kind| kind.split_once('/'))
        .map(|(package, _)| package)
        .collect()
}

#[test]
fn the_interface_package_lists_its_files_and_dependencies() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("msgs/laser_profiler_msgs");
    let cmake = fs::read_to_string(root.join("CMakeLists.txt")).unwrap();
    let package = fs::read_to_string(root.join("package.xml")).unwrap();
    let mut num_files = 0;
    for kind in ["msg", "srv", "action"] {
        for entry in fs::read_dir(root.join(kind)).unwrap() {
            let path = entry.unwrap().path();
            let file = format!("\"{kind}/{}\"", path.file_name().unwrap().to_str().unwrap());
            assert!(cmake.contains(&file), "CMakeLists.txt lacks {file}");
            match kind {
                "srv" => drop(ros2msg::parse_service_file("laser_profiler_msgs", &path).unwrap()),
                "action" => drop(ros2msg::parse_action_file("laser_profiler_msgs", &path).unwrap()),
                _ => drop(ros2msg::parse_message_file("laser_profiler_msgs", &path).unwrap()),
            }
            for name in packages(&fs::read_to_string(&path).unwrap()) {
                assert!(package.contains(&format!("<depend>{name}</depend>")), "{file}: {name}");
                assert!(
                    cmake.contains(&format!("find_package({name} REQUIRED)")),
                    "{file}: {name}"
                );
                let dependencies = cmake.split_once("DEPENDENCIES").unwrap().1;
                assert!(dependencies.split(')').next().unwrap().contains(name), "{file}: {name}");
            }
            num_files += 1;
        }
    }
    assert_eq!(
        cmake.matches(".msg\"").count()
            + cmake.matches(".srv\"").count()
            + cmake.matches(".action\"").count(),
        num_files
    );
}
