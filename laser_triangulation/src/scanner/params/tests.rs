use super::*;
use crate::scanner::{pipeline::Pipeline, stripe::Extractor};

fn extraction() -> ExtractionParams {
    ExtractionParams::default()
}

#[test]
fn values_out_of_range_are_reported_by_name() {
    assert_eq!(Params::default().check_ranges(), Ok(()));
    for (extraction, name) in [
        (ExtractionParams { blur_radius: 24, ..extraction() }, "extraction.blur_radius"),
        (
            ExtractionParams { smoothing_columns: u32::MAX, ..extraction() },
            "extraction.smoothing_columns",
        ),
        (
            ExtractionParams { segment_threshold: f64::NAN, ..extraction() },
            "extraction.segment_threshold",
        ),
        (ExtractionParams { max_width_px: Some(65_536), ..extraction() }, "extraction.max_width"),
    ] {
        assert_eq!(extraction.check_ranges().unwrap_err().name, name);
        let params = Params { extraction, ..Params::default() };
        assert_eq!(params.check_ranges().unwrap_err().name, name);
    }
    let motion = MotionParams { step: Some(f64::NAN), ..MotionParams::default() };
    let params = Params { motion, ..Params::default() };
    assert_eq!(params.check_ranges().unwrap_err().name, "motion.step");
}

#[test]
#[should_panic(expected = "extraction.blur_radius must be an integer from 0 to 15 [px]")]
fn an_extractor_rejects_values_out_of_range() {
    let params = ExtractionParams { blur_radius: 24, ..extraction() };
    let _extractor = Extractor::new(params, StripeDirection::Horizontal);
}

#[test]
#[should_panic(expected = "slice.profiles must be an integer from 1 to 10000 [profiles]")]
fn a_pipeline_rejects_values_out_of_range() {
    let _pipeline = Pipeline::new(Params { slice_profiles: 0, ..Params::default() }, None);
}
