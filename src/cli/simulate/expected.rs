//! Checks the accuracy of the bundled recordings, replayed through the node, that bags/README.md states.

use std::{collections::BTreeMap, path::Path};

use crate::{
    bag::{BagReader, Filter, ReadOptions},
    cli::{recording::TRUTH_TOPIC, replaying::replay},
    msg::{cdr, laser_profiler_msgs::Centerline},
    node::{replay::ReplayRequest, statistics::Summary, stop::Stop},
    ros::arguments::RosArguments,
    scanner::params::StripeDirection,
};

/// Positions across the stripe on each line along it, by stamp, pixels.
type Lines = BTreeMap<i64, BTreeMap<u32, f64>>;

/// Measured minus true centre, pixels, wherever both exist.
#[derive(Debug, Default)]
struct Errors {
    px: Vec<f64>,
    /// Number of lines with a stripe but no measured point.
    missing: usize,
    /// Number of measured points on lines without a stripe.
    false_points: usize,
}

fn centerlines(bag: &Path, topic: &str, direction: StripeDirection) -> Lines {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    let mut lines = Lines::new();
    for message in reader.messages(&Filter::topics([topic])) {
        let message = message.unwrap();
        let centerline: Centerline<'_> = cdr::decode(&message.data).unwrap();
        let (along, across) = match direction {
            StripeDirection::Horizontal => (&centerline.u, &centerline.v),
            StripeDirection::Vertical => (&centerline.v, &centerline.u),
        };
        let points = along.iter().zip(across.iter());
        let points = points.map(|(&along, &across)| (along as u32, f64::from(across))).collect();
        lines.insert(centerline.header.stamp.to_ns(), points);
    }
    lines
}

/// Replays a bundled recording with its parameters and compares every centreline with the ground truth.
fn compare(name: &str, direction: StripeDirection) -> (Summary, Errors) {
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags");
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("results");
    let parameter_files = vec![bags.join(format!("{name}.params.yaml"))];
    let request = ReplayRequest {
        bags: vec![bags.join(name)],
        output: output.clone(),
        ros: RosArguments { parameter_files, ..RosArguments::default() },
        ..ReplayRequest::default()
    };
    let summary = replay(request, &Stop::default()).unwrap();
    let measured = centerlines(&output, "/laser_profiler/centerline", direction);
    let truth = centerlines(&bags.join(name), TRUTH_TOPIC, direction);
    assert!(measured.keys().eq(truth.keys()), "one centreline an image");
    let mut errors = Errors::default();
    for (measured, truth) in measured.values().zip(truth.values()) {
        errors.missing += truth.keys().filter(|line| !measured.contains_key(line)).count();
        errors.false_points += measured.keys().filter(|line| !truth.contains_key(line)).count();
        let both = measured.iter().filter_map(|(line, px)| Some(px - truth.get(line)?));
        errors.px.extend(both);
    }
    errors.px.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    (summary, errors)
}

impl Errors {
    /// Returns the given quantile of the absolute error over all points, pixels.
    fn quantile_px(&self, share: f64) -> f64 {
        self.px[((self.px.len() - 1) as f64 * share) as usize].abs()
    }

    /// Checks the errors against the limits of the README: median, 95 % and all, pixels.
    fn assert_within(&self, limits_px: [f64; 3]) {
        for (share, limit_px) in [0.5, 0.95, 1.0].into_iter().zip(limits_px) {
            let error_px = self.quantile_px(share);
            assert!(error_px <= limit_px, "{error_px} px for {share} of the points");
        }
    }
}

#[test]
fn film_defects_is_measured_as_expected() {
    let (summary, errors) = compare("film_defects", StripeDirection::Horizontal);
    assert_eq!((summary.counts.processed, summary.counts.lost()), (147, 3));
    errors.assert_within([0.008, 0.035, 1.0]);
    assert!(errors.px.len() > 43_900 && errors.missing <= 2, "{}", errors.missing);
    assert!(errors.false_points <= 200, "{}: only where the blur fills a gap", errors.false_points);
}

#[test]
fn saturated_vertical_is_measured_as_expected() {
    let (summary, errors) = compare("saturated_vertical", StripeDirection::Vertical);
    assert_eq!((summary.counts.processed, summary.counts.lost()), (35, 3));
    // The reflection lies 25 px beside the stripe.
    errors.assert_within([0.02, 0.1, 1.0]);
    assert!(errors.px.len() > 3850 && errors.missing <= 2, "{}", errors.missing);
    assert!(errors.false_points <= 60, "{}: only where the blur fills a gap", errors.false_points);
}
