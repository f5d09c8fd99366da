//! Writes a scenario as a rosbag2 recording: images, the axis, the ground truth, and their description.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use serde::Serialize;

use crate::{
    bag::{
        Attachment, MetadataRecord, RecordError, RecordOptions, RecordSummary, Recorder, Times,
        Topic, TopicId,
    },
    cli::recording::TRUTH_TOPIC,
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{Centerline, FrameTrace},
        qos::QosProfile,
        schema::Message,
        sensor_msgs::{CameraInfo, Image, JointState},
        std_msgs::Header,
    },
    scanner::params::StripeDirection,
    simulate::{scene::Scene, sensor::BitDepth, world::RenderedFrame},
};

/// Images of the simulated camera.
const IMAGE_TOPIC: &str = "/camera/image_raw";
/// Description of the simulated camera, unless it is that of formula 6.
const INFO_TOPIC: &str = "/camera/camera_info";
/// Position of the simulated axis.
const AXIS_TOPIC: &str = "/axis/joint_states";

/// Summary of a rendered recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Summary {
    /// Frames taken by the camera.
    pub(crate) frames: u32,
    /// Images in the recording.
    pub(crate) images: u64,
    /// Dropped frames of the scenario.
    pub(crate) dropped: u64,
    /// Path of the recording.
    pub(crate) output: PathBuf,
    /// Length of its MCAP file, bytes.
    pub(crate) bytes: u64,
}

/// Renders a scenario with the text `yaml` into the rosbag2 directory `output`, and writes its calibration next to the
/// MCAP file.
///
/// # Errors
/// An output that exists or cannot be written.
pub(crate) fn record(
    scene: &dyn Scene,
    yaml: &str,
    output: &Path,
    options: RecordOptions,
) -> Result<Summary> {
    let mut writer = Writer::create(scene, output, options)?;
    let mut frame = RenderedFrame::default();
    for number in 0..scene.frames() {
        writer.write_axis(number)?;
        if scene.is_dropped(number) {
            continue;
        }
        scene.render(number, &mut frame);
        writer.write_info(number)?;
        writer.write_image(number, &frame)?;
        if !frame.truth.is_empty() {
            writer.write_truth(number, &frame)?;
        }
    }
    let written = writer.finish(yaml)?;
    let images = written.topics.iter().find(|(name, _)| name == IMAGE_TOPIC);
    let images = images.map_or(0, |(_, count)| *count);
    Ok(Summary {
        frames: scene.frames(),
        images,
        dropped: u64::from(scene.frames()) - images,
        output: written.directory,
        bytes: written.bytes,
    })
}

/// Converts frames to messages.
struct Writer<'a> {
    scene: &'a dyn Scene,
    recorder: Recorder,
    images: TopicId,
    info: Option<TopicId>,
    axis: TopicId,
    truth: TopicId,
    bytes: Vec<u8>,
}

impl<'a> Writer<'a> {
    fn create(
        scene: &'a dyn Scene,
        output: &Path,
        options: RecordOptions,
    ) -> Result<Self, RecordError> {
        let mut recorder = Recorder::create(output, options)?;
        Ok(Self {
            scene,
            info: scene
                .camera()
                .map(|_| {
                    let qos = QosProfile::best_effort(5);
                    recorder.add_topic(&topic::<CameraInfo<'_>>(INFO_TOPIC, qos))
                })
                .transpose()?,
            images: recorder
                .add_topic(&topic::<Image<'_>>(IMAGE_TOPIC, QosProfile::best_effort(5)))?,
            axis: recorder
                .add_topic(&topic::<JointState<'_>>(AXIS_TOPIC, QosProfile::reliable(10)))?,
            truth: recorder
                .add_topic(&topic::<Centerline<'_>>(TRUTH_TOPIC, QosProfile::reliable(10)))?,
            recorder,
            bytes: Vec::new(),
        })
    }

    fn write_axis(&mut self, frame: u32) -> Result<()> {
        let message = JointState {
            header: self.header(frame, ""),
            name: vec!["scan_axis".to_owned()],
            position: vec![self.scene.position_m(frame)],
            velocity: vec![self.scene.velocity_m_s()],
            effort: Vec::new(),
        };
        self.write(self.axis, frame, &message)
    }

    fn write_image(&mut self, frame: u32, rendered: &RenderedFrame) -> Result<()> {
        let picture = self.scene.picture();
        let encoding = match picture.bit_depth {
            BitDepth::Eight => "mono8",
            BitDepth::Twelve | BitDepth::Sixteen => "mono16",
        };
        let message = Image {
            header: self.header(frame, "camera"),
            height: picture.height_px,
            width: picture.width_px,
            encoding: encoding.into(),
            is_bigendian: 0,
            step: picture.width_px * picture.bit_depth.bytes_per_pixel(),
            data: &rendered.samples,
        };
        self.write(self.images, frame, &message)
    }

    /// Writes the camera info with every image, as a driver does.
    fn write_info(&mut self, frame: u32) -> Result<()> {
        let (Some(topic), Some(camera)) = (self.info, self.scene.camera()) else { return Ok(()) };
        let [fx, fy, cx, cy] = [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px];
        let message = CameraInfo {
            header: self.header(frame, "camera"),
            height: camera.height_px,
            width: camera.width_px,
            distortion_model: camera.distortion.name().into(),
            d: camera.distortion.coefficients(),
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        };
        self.write(topic, frame, &message)
    }

    /// Boards have no stripe and therefore no true centre.
    fn write_truth(&mut self, frame: u32, rendered: &RenderedFrame) -> Result<()> {
        let picture = self.scene.picture();
        let mut along = Vec::new();
        let mut across = Vec::new();
        let mut stripe_start = Vec::new();
        let mut was_lit = false;
        for (line, section) in rendered.truth.iter().enumerate() {
            let is_lit = section.center_px.is_finite();
            if is_lit {
                if !was_lit {
                    stripe_start.push(along.len() as u32);
                }
                along.push(line as f32);
                across.push(section.center_px as f32);
            }
            was_lit = is_lit;
        }
        let (u, v) = match picture.stripe_direction {
            StripeDirection::Horizontal => (along, across),
            StripeDirection::Vertical => (across, along),
        };
        let message = Centerline {
            header: self.header(frame, "camera"),
            trace: FrameTrace {
                frame_number: u64::from(frame),
                frame_number_source: FrameTrace::SOURCE_DEVICE,
                position: self.scene.position_m(frame),
                encoder_source: FrameTrace::SOURCE_DEVICE,
                ..FrameTrace::default()
            },
            image_width: picture.width_px,
            image_height: picture.height_px,
            stripe_direction: match picture.stripe_direction {
                StripeDirection::Horizontal => Centerline::STRIPE_HORIZONTAL,
                StripeDirection::Vertical => Centerline::STRIPE_VERTICAL,
            },
            method: "truth".into(),
            u: u.into(),
            v: v.into(),
            stripe_start: stripe_start.into(),
            ..Centerline::default()
        };
        self.write(self.truth, frame, &message)
    }

    /// Writes calibration, scenario and program version into the file, and the calibration also next to it.
    fn finish(mut self, yaml: &str) -> Result<RecordSummary> {
        let calibration = self.scene.calibration_yaml();
        for (name, text) in [("calibration.yaml", calibration.as_str()), ("scenario.yaml", yaml)] {
            self.recorder.attach(&Attachment {
                name: name.to_owned(),
                media_type: "application/yaml".to_owned(),
                log_time_ns: self.scene.stamp_ns(0),
                create_time_ns: self.scene.stamp_ns(0),
                data: text.as_bytes().to_vec(),
            })?;
        }
        let version = env!("CARGO_PKG_VERSION").to_owned();
        self.recorder.metadata(&MetadataRecord {
            name: "laser_profiler".to_owned(),
            entries: [("version".to_owned(), version)].into(),
        })?;
        let written = self.recorder.finish()?;
        let path = written.directory.join("calibration.yaml");
        fs::write(&path, calibration)
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(written)
    }

    fn header(&self, frame: u32, frame_id: &'static str) -> Header<'static> {
        let stamp = Time::from_ns(self.scene.stamp_ns(frame));
        Header { stamp, frame_id: frame_id.into() }
    }

    /// Sequence numbers count frames from 1, so dropped frames leave gaps.
    fn write<M: Message>(&mut self, topic: TopicId, frame: u32, message: &M) -> Result<()> {
        let time_ns = self.scene.stamp_ns(frame);
        let times = Times { log_ns: time_ns, publish_ns: time_ns, sequence: frame + 1 };
        cdr::encode(message, &mut self.bytes)?;
        Ok(self.recorder.write(topic, times, &self.bytes)?)
    }
}

fn topic<M: Message>(name: &str, qos: QosProfile) -> Topic {
    Topic::new(name, M::TYPE, qos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bag::{BagReader, Filter, RawMessage, ReadOptions},
        simulate::scenario::{EXAMPLE, Scenario},
    };

    /// Renders the small scenario into `directory` and returns its messages on `topic`.
    fn small(directory: &Path, yaml: &str, topic: &str) -> (Summary, Vec<RawMessage>) {
        let scenario = Scenario::from_yaml(yaml).unwrap();
        let summary =
            record(&scenario, yaml, &directory.join("bag"), RecordOptions::default()).unwrap();
        let reader = BagReader::open(&summary.output, &ReadOptions::default()).unwrap();
        let messages = reader.messages(&Filter::topics([topic])).collect::<Result<_, _>>();
        (summary, messages.unwrap())
    }

    #[test]
    fn dropped_frames_leave_gaps_in_images_and_truth_but_not_in_the_axis() {
        let counts = [(IMAGE_TOPIC, 38), (TRUTH_TOPIC, 38), (AXIS_TOPIC, 40)];
        for (topic, count) in counts {
            let directory = tempfile::tempdir().unwrap();
            let (summary, messages) = small(directory.path(), EXAMPLE, topic);
            assert_eq!((summary.frames, summary.images, summary.dropped), (40, 38, 2));
            let sequences: Vec<u32> = messages.iter().map(|message| message.sequence).collect();
            let all: Vec<u32> = (1..=40).filter(|n| count == 40 || ![8, 9].contains(n)).collect();
            assert_eq!(sequences, all, "{topic}");
            let stamps =
                messages.iter().map(|message| message.log_time_ns - 1_767_225_600_000_000_000);
            assert!(stamps.eq(all.iter().map(|&n| i64::from(n - 1) * 45_454_545)), "{topic}");
        }
    }

    #[test]
    fn images_truth_and_axis_match_the_scenario() {
        let directory = tempfile::tempdir().unwrap();
        let scenario = Scenario::from_yaml(EXAMPLE).unwrap();
        let (_, images) = small(directory.path(), EXAMPLE, IMAGE_TOPIC);
        let mut rendered = RenderedFrame::default();
        scenario.render(30, &mut rendered);
        let image: Image<'_> = cdr::decode(&images[28].data).unwrap();
        assert_eq!((image.width, image.height, image.step), (160, 96, 160));
        assert_eq!((image.encoding.as_ref(), image.data), ("mono8", rendered.samples.as_slice()));
        assert_eq!(image.header.stamp.to_ns(), scenario.stamp_ns(30));

        let directory = tempfile::tempdir().unwrap();
        let (_, truths) = small(directory.path(), EXAMPLE, TRUTH_TOPIC);
        let truth: Centerline<'_> = cdr::decode(&truths[28].data).unwrap();
        let lit: Vec<(f32, f32)> = (rendered.truth.iter().enumerate())
            .filter(|(_, section)| section.center_px.is_finite())
            .map(|(column, section)| (column as f32, section.center_px as f32))
            .collect();
        let points: Vec<(f32, f32)> =
            truth.u.iter().copied().zip(truth.v.iter().copied()).collect();
        assert_eq!((points, truth.method.as_ref()), (lit, "truth"));
        assert_eq!((truth.trace.frame_number, &truth.stripe_start[..1]), (30, &[0][..]));

        let directory = tempfile::tempdir().unwrap();
        let (_, axis) = small(directory.path(), EXAMPLE, AXIS_TOPIC);
        let joint: JointState<'_> = cdr::decode(&axis[30].data).unwrap();
        assert!((joint.position[0] - 0.010).abs() < 1e-15);
    }

    #[test]
    fn a_vertical_stripe_of_12_bits_is_mono16_and_its_truth_has_whole_rows() {
        let yaml = EXAMPLE
            .replace("width_px: 160", "width_px: 96\n  stripe_direction: vertical\n  bit_depth: 12")
            .replace("height_px: 96", "height_px: 160");
        let directory = tempfile::tempdir().unwrap();
        let (_, images) = small(directory.path(), &yaml, IMAGE_TOPIC);
        let image: Image<'_> = cdr::decode(&images[0].data).unwrap();
        assert_eq!(
            (image.encoding.as_ref(), image.width, image.height, image.step),
            ("mono16", 96, 160, 192)
        );
        let directory = tempfile::tempdir().unwrap();
        let (_, truths) = small(directory.path(), &yaml, TRUTH_TOPIC);
        let truth: Centerline<'_> = cdr::decode(&truths[0].data).unwrap();
        assert!(truth.v.iter().all(|v| v.fract() == 0.0) && truth.v.is_sorted());
        assert!(truth.u.iter().all(|u| (74.9..75.1).contains(u)), "the table: {:?}", truth.u);
    }

    #[test]
    fn the_same_scenario_gives_the_same_self_describing_bytes() {
        let directories = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let files = directories.each_ref().map(|directory| {
            small(directory.path(), EXAMPLE, IMAGE_TOPIC);
            ["bag_0.mcap", "metadata.yaml", "calibration.yaml"]
                .map(|name| fs::read(directory.path().join("bag").join(name)).unwrap())
        });
        assert_eq!(files[0], files[1]);
        let reader =
            BagReader::open(&directories[0].path().join("bag"), &ReadOptions::default()).unwrap();
        let attachments: Vec<_> = reader.attachments().map(Result::unwrap).collect();
        assert_eq!(attachments[0].data, files[0][2]);
        assert_eq!(attachments[1].data, EXAMPLE.as_bytes());
    }

    #[test]
    fn an_existing_output_is_kept_unless_forced() {
        let directory = tempfile::tempdir().unwrap();
        let scenario = Scenario::from_yaml(EXAMPLE).unwrap();
        let again = |force| {
            let options = RecordOptions { force, ..RecordOptions::default() };
            record(&scenario, EXAMPLE, &directory.path().join("bag"), options)
        };
        again(false).unwrap();
        assert!(again(false).unwrap_err().to_string().contains("--force"));
        again(true).unwrap();
    }

    #[test]
    fn the_bundled_recordings_match_their_scenarios() {
        let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags");
        for name in ["film_defects", "saturated_vertical"] {
            let yaml = fs::read_to_string(bags.join(format!("{name}.scenario.yaml"))).unwrap();
            let scenario = Scenario::from_yaml(&yaml).unwrap();
            let directory = tempfile::tempdir().unwrap();
            let rendered = directory.path().join(name);
            record(&scenario, &yaml, &rendered, RecordOptions::default()).unwrap();
            for file in [&format!("{name}_0.mcap"), "metadata.yaml", "calibration.yaml"] {
                let [bundled, rendered] = [bags.join(name), rendered.clone()]
                    .map(|bag| fs::read(bag.join(file)).unwrap());
                assert!(bundled == rendered, "{name}/{file} differs: see bags/README.md");
                assert!(bundled.len() < 2_000_000, "{name}/{file} is too large");
            }
        }
    }
}
