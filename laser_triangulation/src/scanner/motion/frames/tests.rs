use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use nalgebra::{Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::scanner::motion::doubt;

const LIMITS: Limits = Limits { max_gap_ns: Some(1000), max_step: None };
const STRAIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

fn stated<'a>(parent: &'a str, child: &'a str, stamp_ns: i64, x_m: f64) -> Stated<'a> {
    let (origin_m, rotation) = ([x_m, 0.0, 0.0], STRAIGHT);
    Stated { parent, child, stamp_ns, received_ns: stamp_ns, origin_m, rotation, is_static: false }
}

fn tree(poses: &[Stated<'_>]) -> FrameTree {
    let mut tree = FrameTree::new(LIMITS);
    for pose in poses {
        tree.take(pose).unwrap();
    }
    tree
}

const fn pair<'a>(target: &'a str, source: &'a str) -> FramePair<'a> {
    FramePair { target, source }
}

fn x_m(tree: &FrameTree, target: &str, source: &str, time_ns: i64) -> Result<(f64, u8), NotFound> {
    let found = tree.at(pair(target, source), time_ns, i64::MAX)?;
    Ok(((found.value * Point3::origin()).x, found.doubts))
}

#[test]
fn a_frame_is_found_up_and_down_and_across() {
    let mount = Stated { is_static: true, ..stated("/arm", "camera", 0, 10.0) };
    let tree = tree(&[
        stated("world", "arm", 100, 1.0),
        stated("world", "arm", 200, 2.0),
        stated("world", "table", 100, -5.0),
        stated("world", "table", 200, -7.0),
        mount,
    ]);
    assert_eq!(x_m(&tree, "world", "camera", 150), Ok((11.5, 0)));
    assert_eq!(x_m(&tree, "camera", "world", 150), Ok((-11.5, 0)));
    assert_eq!(x_m(&tree, "table", "/camera", 150), Ok((17.5, 0)));
    assert_eq!(x_m(&tree, "arm", "camera", 5), Ok((10.0, 0)), "what stays was always so");
    assert_eq!(x_m(&tree, "table", "camera", 250), Ok((20.5, doubt::EXTRAPOLATED)));
    assert!(
        tree.has_reached(pair("table", "camera"), 200)
            && !tree.has_reached(pair("table", "camera"), 201)
    );
    assert_eq!(tree.gap_ns(pair("table", "camera")), Some(1000));
    assert!(tree.at(pair("table", "camera"), 100, i64::MAX).unwrap().is_exact);
}

#[test]
fn a_turn_is_cut_in_equal_angles() {
    let quarter = [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2];
    // The same turn, stated by both quaternions of opposite sign.
    for rotation in [quarter, quarter.map(|value| -value)] {
        let end = Stated { rotation, ..stated("a", "b", 200, 0.0) };
        let tree = tree(&[stated("a", "b", 100, 0.0), end]);
        for (time_ns, share) in [(125, 0.25), (150, 0.5), (240, 1.4)] {
            let found = tree.at(pair("a", "b"), time_ns, i64::MAX).unwrap().value.rotation;
            let expected = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2 * share);
            assert!(found.angle_to(&expected) < 1e-12, "{time_ns}");
        }
    }
}

#[test]
fn what_cannot_be_found_has_a_reason() {
    let mut tree = tree(&[stated("a", "b", 100, 1.0), stated("c", "d", 100, 1.0)]);
    assert_eq!(x_m(&tree, "x", "b", 100), Err(NotFound::NoTarget));
    assert_eq!(x_m(&tree, "a", "x", 100), Err(NotFound::NoSource));
    assert_eq!(x_m(&tree, "a", "d", 100), Err(NotFound::Apart));
    assert_eq!(x_m(&tree, "a", "b", 99), Err(NotFound::NoPose));
    assert_eq!(tree.names(), "a, b, c, d");
    tree.take(&stated("d", "c", 100, 1.0)).unwrap();
    assert_eq!(x_m(&tree, "a", "d", 100), Err(NotFound::Loop));
    assert_eq!(x_m(&tree, "d", "a", 100), Err(NotFound::Loop));
    assert!(!tree.has_reached(pair("a", "d"), 100), "and it ends");
}

#[test]
fn what_is_no_pose_is_refused_by_name() {
    let mut tree = FrameTree::new(LIMITS);
    let good = stated("a", "b", 100, 1.0);
    for (bad, named) in [
        (Stated { child: "a", ..good }, "\"a\" cannot be placed in \"a\""),
        (Stated { parent: "", ..good }, "cannot be placed"),
        (Stated { rotation: [0.0; 4], ..good }, "\"b\" is not a rotation"),
        (Stated { origin_m: [f64::NAN, 0.0, 0.0], ..good }, "\"b\" is not a rotation"),
        (Stated { rotation: [0.0, 0.0, f64::NAN, 1.0], ..good }, "\"b\" is not a rotation"),
        (Stated { stamp_ns: 0, ..good }, "its stamp is 0"),
    ] {
        let error = tree.take(&bad).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
    for number in 0..MAX_FRAMES + 10 {
        let (parent, child) = ("a".to_owned(), format!("f{number}"));
        drop(tree.take(&Stated { parent: &parent, child: &child, ..good }));
    }
    assert_eq!(tree.frames.len(), MAX_FRAMES);
}

#[test]
fn a_frame_goes_over_to_another() {
    let mut tree = tree(&[stated("hand", "part", 100, 1.0), stated("table", "part", 200, 3.0)]);
    assert_eq!(x_m(&tree, "hand", "part", 200), Err(NotFound::Apart));
    assert_eq!(x_m(&tree, "table", "part", 200), Ok((3.0, 0)));
    tree.forget_moving();
    assert_eq!(x_m(&tree, "table", "part", 200), Err(NotFound::Apart));
}

proptest! {
    /// For any parents and children: nothing panics or loops forever.
    #[test]
    fn any_tangle_of_frames(edges in prop::collection::vec((0..6_u8, 0..6_u8, any::<bool>()), 0..30)) {
        let mut tree = FrameTree::new(LIMITS);
        for (number, (parent, child, is_static)) in edges.into_iter().enumerate() {
            let (parent, child) = (format!("f{parent}"), format!("f{child}"));
            let stamp_ns = number as i64 + 1;
            drop(tree.take(&Stated { is_static, ..stated(&parent, &child, stamp_ns, 1.0) }));
        }
        for target in 0..6 {
            for source in 0..6 {
                let (target, source) = (format!("f{target}"), format!("f{source}"));
                let there = tree.at(pair(&target, &source), 20, i64::MAX);
                let back = tree.at(pair(&source, &target), 20, i64::MAX);
                prop_assert_eq!(there.is_ok(), back.is_ok());
                if let (Ok(there), Ok(back)) = (there, back) {
                    prop_assert!((there.value * back.value).translation.vector.norm() < 1e-9);
                }
            }
        }
    }
}
