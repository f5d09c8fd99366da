//! The stated standard deviation against the scatter along the stripe: on pictures of real cameras, and on rendered
//! speckle, where the ground truth is known, too.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    evaluate::scatter::{ScatterRatio, scatter_ratio, speckle},
    msg::{
        cdr,
        convert::compressed,
        sensor_msgs::{CompressedImage, Image as ImageMessage},
    },
    ros::{
        arguments::RosArguments, names::NodeNames, node_params::NodeParams, parameters::Parameters,
    },
    scanner::{
        frame_index::FrameIndex,
        image::{Frame, Image, OwnedImage, PixelFormat},
        params::{ExtractionParams, Method, NoiseSource, Params},
        pipeline::Pipeline,
    },
};

use crate::recordings::real;

/// Frames of each recording, spread over its length.
const NUM_FRAMES: usize = 20;

/// Limits of scatter ÷ stated standard deviation, of the median over the frames, and below which 95 % of them lie. Between
/// neighbours the median has no lower limit: they share speckles and pixels, so that their differences show less than the
/// stated standard deviation. `gray_gravity` has a limit of its own: its window changes by whole samples from column to
/// column, which the prediction from the blur does not contain.
const MEDIAN: RangeInclusive<f64> = 0.0..=1.25;
const P95: f64 = 2.0;
const P95_GRAY: f64 = 3.0;
/// The same for points 7 px apart, which hardly share any: on real recordings, where sigma contains outliers and noise
/// that may be stated too large, and on rendered speckle. `gray_gravity` jumps where its window changes: sigma contains
/// the jumps, but the median of the differences does not.
const MEDIAN_APART: RangeInclusive<f64> = 0.65..=1.25;
const MEDIAN_APART_RENDERED: RangeInclusive<f64> = 0.85..=1.15;
const MEDIAN_APART_GRAY: RangeInclusive<f64> = 0.45..=1.25;
const P95_APART: f64 = 1.6;
/// The same about the known centres, up to speckle of contrast 0.3 and above it. The centre of gravity is left out: it has a
/// bias of its own, which is larger than the noise.
const ABOUT_TRUTH: RangeInclusive<f64> = 0.75..=1.25;
const ABOUT_TRUTH_ABOVE: RangeInclusive<f64> = 0.6..=1.25;
const MOST_CONTRAST: f64 = 0.3;

/// Pictures of a scene, and how to measure them.
struct Recording {
    name: &'static str,
    params: Params,
    images: Vec<OwnedImage>,
}

fn params(file: &str) -> Params {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("launch_configs").join(file);
    let arguments = RosArguments { parameter_files: vec![path], ..RosArguments::default() };
    let values =
        Parameters::load(&NodeNames::new("laser_profiler", &[]).unwrap(), &arguments).unwrap();
    NodeParams::new(&values).unwrap().cameras.remove(0).scanner
}

fn messages(bag: &Path, topic: &str) -> Vec<Vec<u8>> {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    let all: Vec<_> =
        reader.messages(&Filter::topics([topic])).map(|message| message.unwrap().data).collect();
    let every = all.len().div_ceil(NUM_FRAMES).max(1);
    all.into_iter().step_by(every).collect()
}

fn grey(message: &[u8]) -> OwnedImage {
    let image: ImageMessage<'_> = cdr::decode(message).unwrap();
    (&Image::new(image.width, image.height, image.step, PixelFormat::Mono8, image.data).unwrap())
        .into()
}

fn unpacked(message: &[u8]) -> OwnedImage {
    let message: CompressedImage<'_> = cdr::decode(message).unwrap();
    (&compressed::image(&message, 1 << 24, &mut Vec::new()).unwrap()).into()
}

/// Single pictures: those whose names start with one of `starts`.
fn pictures(folder: &Path, starts: &[&str]) -> Vec<OwnedImage> {
    let mut files: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        starts.iter().any(|start| name.starts_with(start))
    });
    files.sort();
    assert_eq!(files.len(), starts.len(), "{}", folder.display());
    let picture = |path: &PathBuf| {
        let picture = image::open(path).unwrap().to_luma8();
        (&Image::packed(picture.width(), picture.height(), PixelFormat::Mono8, picture.as_raw())
            .unwrap())
            .into()
    };
    files.iter().map(picture).collect()
}

fn recordings() -> Vec<Recording> {
    let of = |name, file, images: fn(&Path) -> Vec<OwnedImage>| {
        real(name).map(|path| Recording { name, params: params(file), images: images(&path) })
    };
    let raw = |path: &Path| messages(path, "/camera/image_raw").iter().map(|m| grey(m)).collect();
    let jpeg = |path: &Path| {
        messages(path, "/camera/image_raw/compressed").iter().map(|m| unpacked(m)).collect()
    };
    let mut all = vec![
        of("turntable_empty", "bright_ambient.yaml", raw),
        of("turntable_object", "halo_and_wall.yaml", raw),
        of("turntable_checkerboard_laser", "bright_ambient.yaml", jpeg),
        of("robot_floor", "noisy_floor.yaml", jpeg),
    ];
    for (name, file, starts) in [
        ("stripes: turntable", "halo_and_wall.yaml", &["s01", "s02", "s03"] as &[&str]),
        ("stripes: faint line", "bright_ambient.yaml", &["s04", "s05", "s06"]),
        ("stripes: wood", "noisy_floor.yaml", &["s07", "s08", "s09", "s10"]),
    ] {
        let images = real("stripes").map(|path| pictures(&path, starts));
        all.push(images.map(|images| Recording { name, params: params(file), images }));
    }
    all.into_iter().flatten().collect()
}

/// Ratios of the frames of a recording that have one.
fn ratios(recording: &Recording, method: Method, noise: NoiseSource) -> Vec<ScatterRatio> {
    let extraction = ExtractionParams { method, noise, ..recording.params.extraction };
    let params = Params { extraction, ..recording.params };
    let mut pipeline = Pipeline::new(params, None);
    let ratio = |image: &OwnedImage| {
        let frame = Frame { stamp_ns: 0, image: image.view() };
        let output = pipeline.process(&frame, FrameIndex::default(), |_| ()).unwrap();
        scatter_ratio(output.centerline, params.stripe_direction, &extraction)
    };
    recording.images.iter().filter_map(ratio).collect()
}

/// Median and 95th percentile of one quantity of the frames; NaN without frames.
fn summary(ratios: &[ScatterRatio], value: impl Fn(&ScatterRatio) -> f64) -> [f64; 2] {
    let mut values: Vec<f64> = ratios.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    [0.5, 0.95]
        .map(|share| laser_profiler::statistics::quantile(&values, share).unwrap_or(f64::NAN))
}

/// A row of the tables.
struct Row<'a> {
    name: &'a str,
    method: Method,
    noise: NoiseSource,
    /// Limits of the median for points 7 px apart.
    median_apart: RangeInclusive<f64>,
}

/// Prints a row and returns a complaint if it is beyond the limits, or if no frame gave a ratio.
fn judged(row: Row<'_>, ratios: &[ScatterRatio]) -> Option<String> {
    let Row { name, method, noise, median_apart } = row;
    let differences = summary(ratios, |ratio| ratio.second_differences);
    let apart = summary(ratios, |ratio| ratio.apart);
    let parabola = summary(ratios, |ratio| ratio.from_parabola);
    let [sigma_px, _] = summary(ratios, |ratio| ratio.sigma_px);
    let row = format!(
        "| {name} | {} | {} | {} | {sigma_px:.4} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
        method.name(),
        noise.name(),
        ratios.len(),
        differences[0],
        differences[1],
        apart[0],
        apart[1],
        parabola[0],
        parabola[1]
    );
    eprintln!("{row}");
    let (p95, median_apart) = match method {
        Method::GrayGravity => (P95_GRAY, MEDIAN_APART_GRAY),
        _ => (P95, median_apart),
    };
    let is_good = !ratios.is_empty()
        && MEDIAN.contains(&differences[0])
        && differences[1] <= p95
        && median_apart.contains(&apart[0])
        && apart[1] <= P95_APART;
    (!is_good).then_some(row)
}

fn head() {
    eprintln!(
        "| scene | method | noise | frames | median sigma px | second differences: median | 95 % | 7 px apart: median | 95 % | from a parabola: median | 95 % |"
    );
    eprintln!("|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|");
}

#[test]
fn on_real_recordings() {
    let recordings = recordings();
    let mut complaints = Vec::new();
    head();
    for recording in &recordings {
        for noise in [NoiseSource::Stated, NoiseSource::Estimated] {
            for method in Method::NAMES.iter().filter_map(|name| Method::from_name(name)) {
                let ratios = ratios(recording, method, noise);
                assert!(ratios.len() <= recording.images.len());
                let row = Row { name: recording.name, method, noise, median_apart: MEDIAN_APART };
                complaints.extend(judged(row, &ratios));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn on_rendered_speckle() {
    let mut complaints = Vec::new();
    head();
    for case in speckle::CASES {
        for method in Method::NAMES.iter().filter_map(|name| Method::from_name(name)) {
            let params = ExtractionParams { method, ..ExtractionParams::default() };
            let found = speckle::run(&params, case);
            assert!(found.along.len() >= 4, "{case:?} {}: {found:?}", method.name());
            let name = format!(
                "speckle {} grain {} px: {:.2} about the truth",
                case.contrast, case.grain_px, found.about_truth
            );
            let median_apart = MEDIAN_APART_RENDERED;
            let row = Row { name: &name, method, noise: params.noise, median_apart };
            complaints.extend(judged(row, &found.along));
            let limits =
                if case.contrast <= MOST_CONTRAST { ABOUT_TRUTH } else { ABOUT_TRUTH_ABOVE };
            if method != Method::GrayGravity && !limits.contains(&found.about_truth) {
                complaints.push(format!("{name} {}", method.name()));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
