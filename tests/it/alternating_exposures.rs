//! Two exposures in turn against each of them alone, on a part with bright and dark surfaces.

use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        exposure_pair::ExposurePairing,
        frame_index::FrameIndex,
        image::{Frame, Image, PixelFormat},
        params::{Exposure, ExtractionParams, Params},
        pipeline::Pipeline,
        stripe::flag,
    },
    simulate::{scenario::Scenario, world::RenderedFrame},
};

/// A dark film on a bright cell, not moving; the stripe crosses both.
const SCENE: &str = "
frames: 40
frame_rate_hz: 22.0
start_time_ns: 1767225600000000000
seed: 5
motion: {start_m: 0.01, step_m: 0.0}
laser: {amplitude: 1800.0, sigma_px: 2.2}
camera:
  width_px: 320
  height_px: 96
  read_noise: 1.5
  shot_gain: 0.02
  image_distance_m: 0.026
  object_distance_m: 0.3
  beta_rad: 0.5235987755982988
  pixel_pitch_m: 9.6e-6
  base_row_px: 75.0
  center_column_px: 159.5
  height_sign: -1
part:
  table_reflectance: 0.9
  cell: {width_m: 0.020, length_m: 0.020, height_m: 0.004, reflectance: 0.8}
  film: {margin_m: 0.004, thickness_m: 0.0002, reflectance: 0.09}
";

/// Results of the frames of a scenario.
#[derive(Debug, Default)]
struct Result {
    errors_px: Vec<f64>,
    num_lit: usize,
    num_saturated: usize,
    pairings: Vec<ExposurePairing>,
}

impl Result {
    fn rms_px(&self) -> f64 {
        let squares: f64 = self.errors_px.iter().map(|error| error * error).sum();
        (squares / self.errors_px.len() as f64).sqrt()
    }

    fn found(&self) -> f64 {
        self.errors_px.len() as f64 / self.num_lit as f64
    }
}

fn alternating() -> Params {
    let defaults = NodeParams::new(&Parameters::default()).unwrap().cameras[0].scanner;
    let extraction = ExtractionParams {
        min_segment_area: 60,
        // Below the dark film's stripe in the short exposure.
        segment_threshold: 12.0,
        width_threshold: 15.0,
        ..defaults.extraction
    };
    Params { exposure: Exposure::Alternating, extraction, ..defaults }
}

/// Measures all frames with these exposure times in turn.
fn measure(factors: &str, exposure: Exposure) -> Result {
    let yaml = SCENE.replacen("seed: 5", &format!("seed: 5\nexposure_factors: {factors}"), 1);
    let scenario = Scenario::from_yaml(&yaml).unwrap();
    let mut pipeline = Pipeline::new(Params { exposure, ..alternating() }, None);
    let mut rendered = RenderedFrame::default();
    let mut result = Result::default();
    for number in 0..scenario.frames {
        scenario.render(number, &mut rendered);
        let image = Image::new(320, 96, 320, PixelFormat::Mono8, &rendered.samples).unwrap();
        let frame = Frame { stamp_ns: scenario.stamp_ns(number), image };
        let index = FrameIndex { frame_number: number.into(), ..FrameIndex::default() };
        let output = pipeline.process(&frame, index, |_| ()).unwrap();
        result.pairings.extend(output.pairing);
        let line = output.centerline;
        let is_saturated = |flags: &&u8| **flags & flag::SATURATED != 0;
        result.num_saturated += line.flags.iter().filter(is_saturated).count();
        // At an edge the blur mixes two surfaces, independent of the exposure.
        let truth = |column: usize| rendered.truth[column].center_px;
        let is_even = |column: usize| {
            (column.saturating_sub(6)..(column + 7).min(320))
                .all(|near| (truth(near) - truth(column)).abs() < 0.5)
        };
        result.num_lit += (0..320).filter(|&column| is_even(column)).count();
        let points = line.u_px.iter().zip(&line.v_px).map(|(&u, &v)| (u as usize, f64::from(v)));
        let errors = points.filter(|point| is_even(point.0)).map(|(u, v)| v - truth(u));
        result.errors_px.extend(errors.filter(|error| error.is_finite()));
    }
    result
}

#[test]
fn both_exposures_together_are_better_than_either() {
    let long = measure("[1.0]", Exposure::Single);
    let short = measure("[0.15]", Exposure::Single);
    let both = measure("[1.0, 0.15]", Exposure::Alternating);
    for (name, result) in [("long", &long), ("short", &short), ("both", &both)] {
        eprintln!(
            "{name}: {:.1} % found, {} saturated, RMS {:.4} px",
            100.0 * result.found(),
            result.num_saturated,
            result.rms_px()
        );
    }
    assert!(long.num_saturated > 40 * 100, "the bright cell saturates");
    assert_eq!(short.num_saturated, 0, "the dark film is faint instead");
    // The first frame has nothing before it.
    assert!(both.num_saturated <= long.num_saturated / 40);
    assert!(both.found() > 0.99 * long.found());
    assert!(both.rms_px() < 0.95 * long.rms_px().min(short.rms_px()));
    assert_eq!(both.pairings[0], ExposurePairing::Alone);
    assert!(
        both.pairings[1..].iter().all(|pairing| matches!(pairing, ExposurePairing::Merged { .. }))
    );
}

#[test]
fn equal_exposures_are_not_merged_and_a_warning_is_logged() {
    let alternating = measure("[1.0]", Exposure::Alternating);
    let single = measure("[1.0]", Exposure::Single);
    assert_eq!(alternating.errors_px, single.errors_px);
    assert!(alternating.pairings[1..].iter().all(|&pairing| pairing == ExposurePairing::Alike));
    assert!(single.pairings.is_empty());
}

/// Result of a long frame after a short one if `between` happens in between.
fn pairing_after(between: impl FnOnce(&mut Pipeline, &mut FrameIndex)) -> ExposurePairing {
    let yaml = SCENE.replacen("seed: 5", "seed: 5\nexposure_factors: [0.15, 1.0]", 1);
    let scenario = Scenario::from_yaml(&yaml).unwrap();
    let mut pipeline = Pipeline::new(alternating(), None);
    let mut rendered = RenderedFrame::default();
    let mut process = |pipeline: &mut Pipeline, index: FrameIndex| {
        scenario.render(index.frame_number as u32, &mut rendered);
        let image = Image::new(320, 96, 320, PixelFormat::Mono8, &rendered.samples).unwrap();
        let frame = Frame { stamp_ns: index.frame_number as i64, image };
        pipeline.process(&frame, index, |_| ()).unwrap().pairing.unwrap()
    };
    assert_eq!(process(&mut pipeline, FrameIndex::default()), ExposurePairing::Alone);
    let mut next = FrameIndex { frame_number: 1, ..FrameIndex::default() };
    between(&mut pipeline, &mut next);
    process(&mut pipeline, next)
}

#[test]
fn nothing_is_merged_over_a_break() {
    assert!(matches!(pairing_after(|_, _| ()), ExposurePairing::Merged { .. }));
    assert_eq!(pairing_after(|_, next| next.frames_missing = 1), ExposurePairing::Alone);
    assert_eq!(pairing_after(|_, next| next.frames_rejected = 1), ExposurePairing::Alone);
    assert_eq!(pairing_after(|pipeline, _| pipeline.discard()), ExposurePairing::Alone);
    assert_eq!(
        pairing_after(|pipeline, _| pipeline.reconfigure(alternating())),
        ExposurePairing::Alone
    );
    let finish = |pipeline: &mut Pipeline, _: &mut FrameIndex| {
        pipeline.finish(0, 0);
    };
    assert_eq!(pairing_after(finish), ExposurePairing::Alone);
}
