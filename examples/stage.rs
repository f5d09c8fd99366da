use laser_profiler::scanner::{
    channel::Plane,
    params::*,
    stripe::{blur::*, section::*, segment::*, tiles::*, *},
};
use laser_profiler::simulate::stripe::*;
use std::time::Instant;
fn main() {
    let scene = StripeScene {
        width: 2592,
        height: 2048,
        amplitude: 199.0,
        sigma_px: 2.2,
        read_noise: 2.0,
        ..StripeScene::default()
    };
    let mut samples = Vec::new();
    render_stripe(&scene, |column| 900.0 + 0.05 * f64::from(column), &mut samples);
    let plane = Plane { width: 2592, height: 2048, stride: 2592, samples: &samples[..] };
    let kernel = Kernel::gaussian(3);
    let mut tiles = BlurredTiles::<u8>::default();
    let mut regions = Regions::default();
    let params = ExtractionParams {
        method: Method::ImprovedGravity,
        window: laser_profiler::scanner::params::Window::Fractional,
        blur_radius: 3,
        segment_threshold: 35.0,
        min_segment_area: 500,
        width_threshold: 50.0,
        peak_selection: PeakSelection::Brightest,
        read_noise: 2.0,
        shot_gain: 0.0,
    };
    let mut ex = fast::FastExtractor::<u8>::new(params, StripeDirection::Horizontal);
    let mut cl = Centerline::default();
    let mut t = [vec![], vec![], vec![], vec![], vec![]];
    for _ in 0..20 {
        let a = Instant::now();
        tiles.compute(&plane, &kernel, 35 * 256);
        let b = Instant::now();
        tiles.segment(35 * 256, &mut regions);
        let c = Instant::now();
        let n = regions.larger_than(500).count();
        let d = Instant::now();
        ex.extract(&plane, (0, 0), 255, &mut cl);
        let e = Instant::now();
        std::hint::black_box(n);
        for (v, x) in t.iter_mut().zip([b - a, c - b, d - c, e - d]) {
            v.push(x.as_secs_f64() * 1e6);
        }
    }
    for v in &mut t {
        v.sort_by(f64::total_cmp);
        if !v.is_empty() {
            println!("{:.1} us", v[v.len() / 2]);
        }
    }
    for m in [Method::GrayGravity, Method::GaussianFit, Method::ImprovedGravity] {
        let mut ex = fast::FastExtractor::<u8>::new(
            ExtractionParams { method: m, ..params },
            StripeDirection::Horizontal,
        );
        let mut v = vec![];
        for _ in 0..3 {
            let d = Instant::now();
            ex.extract(&plane, (0, 0), 255, &mut cl);
            v.push(d.elapsed().as_secs_f64() * 1e6);
        }
        v.sort_by(f64::total_cmp);
        println!("{m:?} {:.1} us", v[1]);
    }
}
