//! Camera files of other programs, and errors in plain words.

use crate::scanner::{
    calibration::{Calibration, CameraCalibration},
    camera::Distortion,
};

const K: &str = "[1727.79, 0.0, 959.25, 0.0, 1727.67, 539.72, 0.0, 0.0, 1.0]";

fn read(text: &str) -> CameraCalibration {
    // Every one of these is recognised where a laser plane is wanted, too.
    let error = Calibration::from_yaml(text).unwrap_err().to_string();
    assert!(error.contains("calibrate plane") && error.contains("--camera"), "{error}");
    CameraCalibration::from_yaml(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn error(text: &str) -> String {
    CameraCalibration::from_yaml(text).unwrap_err().to_string()
}

/// The camera that all good files state, apart from its lens.
fn check(found: &CameraCalibration, distortion: Distortion) {
    let camera = &found.camera;
    assert_eq!((camera.width_px, camera.height_px), (1920, 1080));
    assert_eq!((camera.fx_px, camera.fy_px), (1727.79, 1727.67));
    assert_eq!((camera.cx_px, camera.cy_px), (959.25, 539.72));
    assert_eq!(camera.distortion, distortion);
    let again = CameraCalibration::from_yaml(&found.to_yaml()).unwrap();
    assert_eq!(&again, found);
}

const PLUMB_BOB: Distortion =
    Distortion::PlumbBob { k1: 0.1, k2: -0.2, p1: 0.001, p2: -0.002, k3: 0.05 };
const FOUR: Distortion = Distortion::PlumbBob { k1: 0.1, k2: -0.2, p1: 0.001, p2: -0.002, k3: 0.0 };
const FISHEYE: Distortion = Distortion::Equidistant { k1: 0.1, k2: -0.2, k3: 0.001, k4: -0.002 };

const XML: &str = "<?xml version=\"1.0\"?>\n<opencv_storage>\n</opencv_storage>";

#[test]
fn files_of_opencv_are_read() {
    let yaml = |rest: &str| {
        format!(
            "%YAML:1.0\n---\ncalibration_time: \"Tue 21 Nov 2023\"\nimage_width: 1920\nimage_height: 1080\n\
             camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {K}\n{rest}"
        )
    };
    let d = |count: usize, data: &str| {
        format!(
            "distortion_coefficients: !!opencv-matrix\n   rows: {count}\n   cols: 1\n   dt: d\n   data: {data}\n"
        )
    };
    let five = d(5, "[ 0.1, -0.2, 1.0e-03, -2.e-03, .05 ]");
    check(&read(&yaml(&five)), PLUMB_BOB);
    check(&read(&yaml(&five).replace("camera_matrix", "Camera_Matrix")), PLUMB_BOB);
    let sized =
        yaml(&five).replace("image_width: 1920\nimage_height: 1080", "imageSize: [1920, 1080]");
    check(
        &read(&sized.replace("camera_matrix", "K").replace("distortion_coefficients", "D")),
        PLUMB_BOB,
    );
    check(
        &read(&yaml(&format!("fisheye_model: 1\n{}", d(4, "[ 0.1, -0.2, 0.001, -0.002 ]")))),
        FISHEYE,
    );
    let json = format!(
        "{{\"image_width\": 1920, \"image_height\": 1080, \"cameraMatrix\": {{\"type_id\": \"opencv-matrix\", \"rows\": 3, \
         \"cols\": 3, \"dt\": \"d\", \"data\": {K}}}, \"distCoeffs\": {{\"type_id\": \"opencv-matrix\", \"rows\": 1, \"cols\": 5, \
         \"dt\": \"d\", \"data\": [0.1, -0.2, 0.001, -0.002, 0.05]}}}}"
    );
    check(&read(&json), PLUMB_BOB);
    // What scripts write: rows as lists.
    let script = "image_width: 1920\nimage_height: 1080\ncamera_matrix:\n- [1727.79, 0.0, 959.25]\n- [0.0, 1727.67, 539.72]\n\
                  - [0.0, 0.0, 1.0]\ndist_coeff:\n- [0.1, -0.2, 0.001, -0.002, 0.05]\n";
    check(&read(script), PLUMB_BOB);

    for (text, word) in [
        (yaml(&d(4, "[ 0.1, -0.2, 0.001, -0.002 ]")), "`distortion_model` with `plumb_bob`"),
        (yaml(&five).replace("image_width: 1920\n", ""), "image_width"),
        (yaml(&five).replace("rows: 5", "rows: 4"), "rows x cols"),
        (yaml(""), "distortion_coefficients is missing"),
        (yaml(&five).replace("1080", "300"), "cy = 539.72 px lies outside"),
        (yaml(&five).replace("1727.79", ".Nan"), "camera_matrix is not a list of finite numbers"),
        (XML.to_owned(), "XML is not read"),
    ] {
        let error = error(&text);
        assert!(error.contains("OpenCV") && error.contains(word), "{word}: {error}");
    }
    let error = Calibration::from_yaml(XML).unwrap_err().to_string();
    assert!(error.contains("XML is not read"), "{error}");
}

#[test]
fn camera_chains_of_kalibr_are_read() {
    let chain = |model: &str| {
        format!(
            "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.2, 0.001, -0.002]\n  \
             distortion_model: {model}\n  intrinsics: [1727.79, 1727.67, 959.25, 539.72]\n  resolution: [1920, 1080]\n  \
             rostopic: /cam0/image_raw\n"
        )
    };
    check(&read(&chain("radtan")), FOUR);
    check(&read(&chain("equidistant")), FISHEYE);
    check(&read(&chain("radtan").replace("cam0:", "cam1:")), FOUR);
    assert_eq!(read(&chain("radtan")).camera_name, "cam0");
    let two = chain("radtan") + &chain("radtan").replace("cam0:", "cam1:");
    for (text, word) in [
        (two, "2 cameras (cam0, cam1)"),
        (chain("fov"), "\"fov\""),
        (chain("radtan").replace("pinhole", "omni"), "\"omni\""),
        (chain("radtan").replace(", 539.72", ""), "[fu, fv, pu, pv]"),
        (chain("radtan").replace("  resolution: [1920, 1080]\n", ""), "resolution is missing"),
        (chain("radtan").replace("[1920, 1080]", "[1920]"), "resolution has 1 numbers"),
        (chain("radtan").replace("[0.1, ", "["), "three numbers, not four"),
    ] {
        let error = error(&text).replace("has 3 numbers", "has three numbers");
        assert!(error.contains("Kalibr") && error.contains(word), "{word}: {error}");
    }
}

#[test]
fn printed_camera_infos_are_read() {
    let message = format!(
        "header:\n  stamp:\n    sec: 1\n    nanosec: 0\n  frame_id: cam\nheight: 1080\nwidth: 1920\ndistortion_model: plumb_bob\n\
         d:\n- 0.1\n- -0.2\n- 0.001\n- -0.002\n- 0.05\nk: {K}\nr: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\np: []\n\
         binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n"
    );
    check(&read(&message), PLUMB_BOB);
    check(&read(&message.repeat(3)), PLUMB_BOB);
    check(&read(&message.replace("\nk:", "\nK:").replace("\nd:", "\nD:")), PLUMB_BOB);
    let fisheye = message.replace("plumb_bob", "equidistant").replace("- 0.05\n", "");
    check(&read(&fisheye), FISHEYE);
    assert_eq!(read(&message).camera_name, "cam");
    for (text, word) in [
        (message.replace("1727.79", "0.0"), "no calibration"),
        (message.replace("width: 1920\n", ""), "width is missing"),
        (message.clone() + &message.replace("1727.79", "1700.0"), "different cameras"),
        (message.replace("width: 1920", "width: 1920.5"), "width is not a whole number"),
    ] {
        let error = error(&text);
        assert!(error.contains("ros2 topic echo") && error.contains(word), "{word}: {error}");
    }
    let error = error(&message.replace("plumb_bob", "fov"));
    assert!(error.contains("distortion_model is fov"), "{error}");
}

const OST: &str = "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n1920\n\nheight\n1080\n\n[narrow_stereo]\n\n\
                   camera matrix\n1727.790000 0.000000 959.250000\n0.000000 1727.670000 539.720000\n0.000000 0.000000 1.000000\n\n\
                   distortion\n0.100000 -0.200000 0.001000 -0.002000 0.050000\n\nrectification\n1.000000 0.000000 0.000000\n\
                   0.000000 1.000000 0.000000\n0.000000 0.000000 1.000000\n\nprojection\n1.0 0.0 0.0 0.0\n";

#[test]
fn files_of_camera_calibration_are_read() {
    check(&read(OST), PLUMB_BOB);
    check(&read(&OST.replace('\n', "\r\n")), PLUMB_BOB);
    check(&read(&OST.replace("0.050000\n", "0.050000 0.000000 0.000000 0.000000\n")).clone(), {
        let Distortion::PlumbBob { k1, k2, p1, p2, k3 } = PLUMB_BOB else { unreachable!() };
        Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4: 0.0, k5: 0.0, k6: 0.0 }
    });
    assert_eq!(read(OST).camera_name, "narrow_stereo");
    for (text, word) in [
        (OST.replace("height\n1080", ""), "height is missing"),
        (OST.replace(" 0.050000", ""), "ost.yaml"),
        (OST.replace("width\n1920", "width\nwide"), "width is not a whole number"),
    ] {
        let error = error(&text);
        assert!(error.contains("ost.txt") && error.contains(word), "{word}: {error}");
    }
    let yaml = |model: &str, count: usize, data: &str| {
        format!(
            "image_width: 1920\nimage_height: 1080\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: {K}\n\
             distortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {count}\n  data: [{data}]\n"
        )
    };
    let five = "0.1, -0.2, 0.001, -0.002, 0.05";
    check(&read(&yaml("plumb_bob", 8, &format!("{five}, 0.0, 0.0, 0.0"))), PLUMB_BOB);
    check(&read(&yaml("equidistant", 4, "0.1, -0.2, 0.001, -0.002")), FISHEYE);
    check(&read(&yaml("fisheye", 4, "0.1, -0.2, 0.001, -0.002")), FISHEYE);
    let tilted =
        read(&yaml("rational_polynomial", 14, &format!("{five}, 0, 0, 0, 0, 0, 0, 0, 0.01, 0.02")));
    assert_eq!(tilted.camera.tilt_rad.map(f64::to_bits), [0.01, 0.02].map(f64::to_bits));
    let thin = error(&yaml("rational_polynomial", 12, &format!("{five}, 0, 0, 0, 0.1, 0, 0, 0")));
    assert!(thin.contains("thin-prism"), "{thin}");
}

const RIG: &str = "type: camera_and_plane\nframe_id: laser\nimage_width: 1920\nimage_height: 1080\n\
                   camera_matrix: {rows: 3, cols: 3, data: [1700.0, 0, 959, 0, 1700.0, 539, 0, 0, 1]}\ndistortion_model: plumb_bob\n\
                   distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n\
                   laser_plane:\n  normal: [0.0, -0.866, 0.5]\n  distance_m: 0.15\n";

/// Key and line, and no word of a parser or of Rust.
#[test]
fn mistakes_are_named_with_key_and_line() {
    Calibration::from_yaml(RIG).unwrap();
    for (from, to, words) in [
        (
            "image_width",
            "image_with",
            &["line 3", "`image_with`", "did you mean `image_width`"][..],
        ),
        ("frame_id", "K", &["line 2", "unknown key `K`", "known are"]),
        ("distortion_model: plumb_bob\n", "", &["`distortion_model` is missing"]),
        (
            "image_width: 1920",
            "image_width: wide",
            &["line 3", "image_width must be a whole number"],
        ),
        (
            "image_width: 1920",
            "image_width: 1920\nimage_width: 1920",
            &["line 4", "`image_width`", "twice"],
        ),
        ("[0.0, -0.866, 0.5]", "[0.0, -0.866]", &["line 9", "laser_plane.normal", "3"]),
        ("[0.0, -0.866, 0.5]", "[0.0, -0.866, 0.5, 1.0]", &["line 9", "laser_plane.normal", "3"]),
        ("[0.0, -0.866, 0.5]", "up", &["line 9", "laser_plane.normal", "list"]),
        ("0.15", "near", &["line 10", "laser_plane.distance_m must be a number"]),
        ("[1700.0, 0,", "[1700.0,", &["camera_matrix", "9 numbers"]),
        ("0.15", ".nan", &["line 10", "laser_plane.distance_m is .nan", "finite"]),
        ("normal: [", "normal: [[", &["line"]),
    ] {
        let text = RIG.replacen(from, to, 1);
        assert_ne!(text, RIG, "{from}");
        let error = Calibration::from_yaml(&text).unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "{word}: {error}");
        }
        for jargon in ["struct", "f64", "u32", "sequence", "field", "array", "usize"] {
            assert!(!error.contains(jargon), "{jargon}: {error}");
        }
    }
}

/// The example of the documentation is complete.
#[test]
fn the_documented_example_is_a_calibration() {
    let page = include_str!("../../../../../docs/calibration.md");
    let (_, example) = page.split_once("```yaml\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    let calibration = Calibration::from_yaml(example).unwrap();
    let Calibration::CameraAndPlane(geometry) = &calibration else { panic!("{calibration:?}") };
    assert_eq!(calibration.image_size_px(), Some((2592, 2048)));
    assert_eq!((geometry.camera.fx_px, geometry.plane.distance_m), (2400.0, 0.15));
    assert!(calibration.axis().is_some());
    // Every key of the example is in the table.
    for key in example.lines().filter_map(|line| line.split_once(':')).map(|(key, _)| key) {
        assert!(page.contains(&format!("`{key}")), "{key}");
    }
}
