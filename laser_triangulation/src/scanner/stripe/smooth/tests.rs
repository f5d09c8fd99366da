//! Smoothing against lines whose truth is a formula.

use super::*;
use crate::{scanner::params::Method, simulate::noise::frame_rng};
use rand_distr::{Distribution, StandardNormal};

const SIGMA_PX: f32 = 0.05;

fn smoother(smoothing_columns: u32, direction: StripeDirection) -> Smoother {
    let method = Method::GaussianMl;
    let params = ExtractionParams { method, smoothing_columns, ..ExtractionParams::default() };
    Smoother::new(&params, direction)
}

/// One connected stripe about `truth`, with white noise of `noise` times [`SIGMA_PX`] in every column.
fn noisy(num: u32, noise: f64, truth: impl Fn(f64) -> f64) -> Centerline {
    let mut rng = frame_rng(7, 0);
    let deviations = (0..num).map(|_| Distribution::<f64>::sample(&StandardNormal, &mut rng));
    let across = (0..num).zip(deviations).map(|(column, deviation)| {
        (truth(f64::from(column)) + noise * f64::from(SIGMA_PX) * deviation) as f32
    });
    Centerline {
        v_px: across.collect(),
        u_px: (0..num).map(|column| column as f32).collect(),
        stripe_start: vec![0],
        width_px: vec![5.0; num as usize],
        intensity: vec![180.0; num as usize],
        sigma_px: vec![SIGMA_PX; num as usize],
        flags: vec![0; num as usize],
    }
}

fn smoothed(smoothing_columns: u32, line: &Centerline) -> Centerline {
    let mut line = line.clone();
    smoother(smoothing_columns, StripeDirection::Horizontal).smooth(&mut line);
    line
}

fn errors_px(line: &Centerline, truth: impl Fn(f64) -> f64) -> Vec<f64> {
    let points = line.u_px.iter().zip(&line.v_px);
    points.map(|(&u, &v)| f64::from(v) - truth(f64::from(u))).collect()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Returns the shares of errors within one and two σ.
fn coverage(line: &Centerline, errors: &[f64]) -> [f64; 2] {
    [1.0, 2.0].map(|sigmas| {
        let pairs = errors.iter().zip(&line.sigma_px);
        let within = pairs.filter(|(e, s)| e.abs() <= sigmas * f64::from(**s)).count();
        within as f64 / errors.len() as f64
    })
}

#[test]
fn one_column_changes_no_bit() {
    let line = noisy(100, 1.0, |x| 30.0 + x.sin());
    assert_eq!(smoothed(1, &line), line);
}

#[test]
fn white_noise_and_sigma_fall_with_the_root_of_the_points() {
    let slope = |x: f64| 20.0 + 0.31 * x;
    let line = noisy(4000, 1.0, slope);
    for num in [3, 5, 9, 21] {
        let smooth = smoothed(num, &line);
        let errors = errors_px(&smooth, slope);
        let expected = f64::from(SIGMA_PX) / f64::from(num).sqrt();
        let bias = errors.iter().sum::<f64>() / 4000.0;
        assert!((rms(&errors) / expected - 1.0).abs() < 0.08, "{num}: {}", rms(&errors) / expected);
        assert!(bias.abs() < 4.0 * f64::from(SIGMA_PX) / 4000_f64.sqrt(), "{num}: {bias}");
        let [one, two] = coverage(&smooth, &errors);
        assert!((one - 0.683).abs() < 0.03 && (two - 0.954).abs() < 0.015, "{num}: {one} {two}");
        assert_eq!((&smooth.width_px, &smooth.flags), (&line.width_px, &line.flags));
    }
}

#[test]
fn a_step_stays_where_it_is() {
    for (height_px, limit_px) in [(7.0, 0.2), (0.6, 0.2)] {
        let step = |x: f64| if x < 200.0 { 30.0 } else { 30.0 + height_px };
        let line = noisy(400, 1.0, step);
        for num in [3, 5, 9, 31] {
            let errors = errors_px(&smoothed(num, &line), step);
            let worst = errors.iter().fold(0.0_f64, |worst, e| worst.max(e.abs()));
            assert!(worst < limit_px, "{num}, {height_px} px: {worst} px");
        }
    }
}

#[test]
fn a_narrow_groove_is_left_alone() {
    let groove = |x: f64| if (200.0..203.0).contains(&x) { 37.3 } else { 30.0 };
    let errors = errors_px(&smoothed(9, &noisy(400, 1.0, groove)), groove);
    assert!(errors.iter().all(|e| e.abs() < 0.2));
}

#[test]
fn noise_that_was_stated_too_low_is_seen_in_the_scatter() {
    let line = noisy(4000, 3.0, |x| 20.0 + 0.1 * x);
    let smooth = smoothed(9, &line);
    let errors = errors_px(&smooth, |x| 20.0 + 0.1 * x);
    assert!((rms(&errors) / f64::from(SIGMA_PX) - 1.0).abs() < 0.1, "{}", rms(&errors));
    assert!((coverage(&smooth, &errors)[0] - 0.683).abs() < 0.03);
}

#[test]
fn curvature_biases_by_the_stated_amount_and_not_without_limit() {
    // y'' = 2e-3: h = 4 gives 2e-3 · 4 · 5 / 6 = 6.7e-3 px, far below the noise.
    let bend = |x: f64| 30.0 + 1e-3 * (x - 200.0).powi(2);
    let errors = errors_px(&smoothed(9, &noisy(400, 0.0, bend)), bend);
    assert!((errors[200] - 2e-3 * 20.0 / 6.0).abs() < 1e-4, "{}", errors[200]);
    // A tighter one is not smoothed away: its error stays below the noise.
    let tight = |x: f64| 30.0 + 0.1 * (x - 200.0).powi(2);
    let errors = errors_px(&smoothed(9, &noisy(400, 0.0, tight)), tight);
    assert!(errors.iter().all(|e| e.abs() < 2.0 * f64::from(SIGMA_PX)));
}

#[test]
fn stripes_are_not_mixed_and_gaps_stay() {
    let mut line = noisy(60, 1.0, |x| if x < 30.0 { 20.0 } else { 20.1 });
    line.stripe_start = vec![0, 30];
    let both = smoothed(9, &line);
    let mut first = line.clone();
    for values in [&mut first.u_px, &mut first.v_px, &mut first.sigma_px] {
        values.truncate(30);
    }
    first.stripe_start = vec![0];
    assert_eq!(smoothed(9, &first).v_px, both.v_px[..30]);
    // A line with a missing column is smoothed over the remaining columns.
    line.u_px.iter_mut().skip(10).for_each(|u| *u += 1.0);
    let gap = smoothed(9, &line);
    assert_eq!(gap.u_px, line.u_px);
}

#[test]
fn a_vertical_stripe_and_an_unknown_sigma_are_the_same() {
    let mut line = noisy(200, 1.0, |x| 20.0 + 0.2 * x);
    line.sigma_px[50] = f32::NAN;
    let horizontal = smoothed(5, &line);
    assert_eq!(horizontal.v_px[50].to_bits(), line.v_px[50].to_bits());
    let mut vertical = line.clone();
    std::mem::swap(&mut vertical.u_px, &mut vertical.v_px);
    smoother(5, StripeDirection::Vertical).smooth(&mut vertical);
    assert_eq!(vertical.u_px, horizontal.v_px);
}
