use proptest::prelude::*;

use super::*;

/// Strong barrel, strong pincushion, a wide lens of eight coefficients, and fisheyes: a real one, an ideal one, one that folds
/// back at 64 degrees, and one that stretches the rim.
const LENSES: [Distortion; 7] = [
    Distortion::Equidistant { k1: -0.0071, k2: 0.0427, k3: -0.0402, k4: 0.0074 },
    Distortion::Equidistant { k1: 0.0, k2: 0.0, k3: 0.0, k4: 0.0 },
    Distortion::Equidistant { k1: -0.27, k2: 0.0, k3: 0.0, k4: 0.0 },
    Distortion::Equidistant { k1: 0.1, k2: 0.05, k3: 0.01, k4: 0.002 },
    Distortion::PlumbBob { k1: -0.45, k2: 0.25, p1: 0.002, p2: -0.003, k3: -0.06 },
    Distortion::PlumbBob { k1: 0.35, k2: 0.2, p1: -0.004, p2: 0.002, k3: 0.1 },
    Distortion::RationalPolynomial {
        k1: 8.2,
        k2: 4.6,
        p1: -0.0002,
        p2: 0.0007,
        k3: 0.21,
        k4: 8.6,
        k5: 7.4,
        k6: 1.2,
    },
];

/// Radius beyond which a lens is not measured.
fn limit(lens: &Distortion) -> f64 {
    (1..8000).map(|k| f64::from(k) * 1e-3).take_while(|r| lens.is_before_fold(*r)).last().unwrap()
}

proptest! {
    #[test]
    fn undistort_undoes_distort_up_to_the_fold(
        lens in 0..LENSES.len(), share in 0.0..0.999_f64, angle in 0.0..std::f64::consts::TAU,
    ) {
        let lens = LENSES[lens];
        let radius = share * limit(&lens);
        let straight = UndistortedPoint(Point2::new(radius * angle.cos(), radius * angle.sin()));
        let bent = lens.distort(straight).unwrap();
        let again = lens.distort(lens.undistort(bent).unwrap()).unwrap();
        let relative = (again.0 - bent.0).norm() / (1.0 + bent.0.coords.norm());
        prop_assert!(relative < 1e-11, "{bent:?} {again:?}");
    }

    #[test]
    fn the_jacobian_is_the_derivative(
        lens in 0..LENSES.len(), x in -0.6..0.6_f64, y in -0.6..0.6_f64,
    ) {
        let (lens, h) = (LENSES[lens], 1e-6);
        let bend = |step: Vector2<f64>| lens.bend(UndistortedPoint(Point2::new(x, y) + step));
        let jacobian = bend(Vector2::zeros()).1;
        for (column, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].into_iter().enumerate() {
            let at = |sign: f64| bend(step * sign).0.0;
            let difference = (at(1.0) - at(-1.0)) / (2.0 * h);
            prop_assert!((jacobian.column(column) - difference).norm() < 1e-8);
        }
    }

    /// Wherever an answer exists, it is the ray seen at that position.
    #[test]
    fn no_ray_is_wrong(lens in 0..LENSES.len(), x in -20.0..20.0_f64, y in -20.0..20.0_f64) {
        let (lens, bent) = (LENSES[lens], DistortedPoint(Point2::new(x, y)));
        if let Some(straight) = lens.undistort(bent) {
            prop_assert!((lens.distort(straight).unwrap().0 - bent.0).norm() < 1e-10);
        }
    }
}

#[test]
fn beyond_the_fold_nothing_is_measured() {
    let barrel = Distortion::PlumbBob { k1: -0.3, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
    // r (1 - 0.3 r²) is largest at r² = 1 / 0.9, where it is 0.7027.
    let fold = (1.0_f64 / 0.9).sqrt();
    assert!(barrel.distort(UndistortedPoint(Point2::new(fold - 1e-6, 0.0))).is_some());
    assert!(barrel.distort(UndistortedPoint(Point2::new(0.0, fold + 1e-6))).is_none());
    let edge = fold * 2.0 / 3.0;
    let near_edge = |step: f64| barrel.undistort(DistortedPoint(Point2::new(edge + step, 0.0)));
    let UndistortedPoint(straight) = near_edge(-1e-6).unwrap();
    assert!((fold - 0.01..fold).contains(&straight.x), "{straight}");
    assert!(near_edge(1e-6).is_none());
}

#[test]
fn what_is_no_place_has_no_ray() {
    for lens in LENSES {
        for bent in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(lens.undistort(DistortedPoint(Point2::new(bent, 0.0))).is_none());
            assert!(lens.distort(UndistortedPoint(Point2::new(bent, 0.0))).is_none());
        }
    }
}

/// θ (1 - 0.27 θ²) is largest at θ² = 1 / 0.81, where it is 2/3 θ.
#[test]
fn a_fisheye_is_measured_up_to_its_largest_angle() {
    let folding = Distortion::Equidistant { k1: -0.27, k2: 0.0, k3: 0.0, k4: 0.0 };
    let fold_rad = 1.0 / 0.9_f64;
    let seen = |angle: f64| folding.distort(UndistortedPoint(Point2::new(angle.tan(), 0.0)));
    assert!(seen(fold_rad - 1e-6).is_some() && seen(fold_rad + 1e-6).is_none());
    let ray = |place: f64| folding.undistort(DistortedPoint(Point2::new(0.0, place)));
    let UndistortedPoint(straight) = ray(fold_rad * 2.0 / 3.0 - 1e-8).unwrap();
    assert!((fold_rad - 1e-3..fold_rad).contains(&straight.y.atan()), "{straight}");
    assert!(ray(fold_rad * 2.0 / 3.0 + 1e-8).is_none());
    // Without a fold: up to 83 degrees off the axis, and no further.
    let ideal = Distortion::Equidistant { k1: 0.0, k2: 0.0, k3: 0.0, k4: 0.0 };
    for (angle, is_seen) in [(1.44_f64, true), (1.45, false), (1.57, false), (3.0, false)] {
        let ray = ideal.undistort(DistortedPoint(Point2::new(-angle, 0.0)));
        assert_eq!(ray.is_some(), is_seen, "{angle}");
        if let Some(UndistortedPoint(ray)) = ray {
            assert!((ray.x + angle.tan()).abs() < 1e-9, "{ray}");
        }
    }
}

#[test]
fn coefficients_are_read_by_opencvs_counts_and_zeros_beyond_the_model_mean_nothing() {
    let read = |name: &str, d: &[f64]| Distortion::from_coefficients(name, d);
    let (k1, k2, p1, p2, k3) = (-0.3, 0.1, 0.001, 0.002, 0.05);
    let plumb_bob = Ok(Distortion::PlumbBob { k1, k2, p1, p2, k3 });
    assert_eq!(read("plumb_bob", &[k1, k2, p1, p2, k3]), plumb_bob);
    assert_eq!(read("plumb_bob", &[k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]), plumb_bob);
    assert_eq!(
        read("plumb_bob", &[k1, k2, p1, p2]),
        Ok(Distortion::PlumbBob { k1, k2, p1, p2, k3: 0.0 })
    );
    let rational =
        |k4| Ok(Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5: 0.0, k6: 0.0 });
    assert_eq!(read("rational_polynomial", &[k1, k2, p1, p2, k3]), rational(0.0));
    let mut fourteen = [0.0; 14];
    fourteen[..6].copy_from_slice(&[k1, k2, p1, p2, k3, 0.4]);
    assert_eq!(read("rational_polynomial", &fourteen), rational(0.4));
    let equidistant = |k1| Ok(Distortion::Equidistant { k1, k2: 0.0, k3: 0.0, k4: 0.0 });
    assert_eq!(read("equidistant", &[0.1, 0.0, 0.0, 0.0]), equidistant(0.1));
    assert_eq!(read("equidistant", &[0.1, 0.0, 0.0, 0.0, 0.0]), equidistant(0.1));
    // An ideal fisheye is not a pinhole; a pinhole is one under either other name.
    assert_eq!(read("equidistant", &[0.0; 4]), equidistant(0.0));
    for d in [&[][..], &[0.0; 3], &[0.0; 14]] {
        assert_eq!(read("plumb_bob", d), Ok(Distortion::None));
        assert_eq!(read("rational_polynomial", d), Ok(Distortion::None));
    }
    for (name, d) in [
        ("plumb_bob", &[0.1, 0.0][..]),
        ("plumb_bob", &[0.1, 0.0, 0.0, 0.0, 0.0, 0.2]),
        ("rational_polynomial", &[0.1; 7]),
        ("rational_polynomial", &[0.1; 12]),
        ("equidistant", &[]),
        ("equidistant", &[0.1; 3]),
        ("equidistant", &[0.1; 5]),
    ] {
        let allowed = read(name, d).unwrap_err().unwrap();
        assert!(allowed.contains(name), "{allowed}");
    }
    assert_eq!(read("fov", &[0.1]), Err(None));
}
