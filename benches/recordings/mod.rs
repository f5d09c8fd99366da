//! Recordings of a rendered stripe, to be replayed by benchmarks.

use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use laser_profiler::{
    bag::{Compression, RecordOptions, Recorder, Times, Topic},
    msg::{
        builtin_interfaces::Time, cdr, qos::QosProfile, schema::Message, sensor_msgs,
        std_msgs::Header,
    },
    node::replay::ReplayRequest,
    simulate::stripe::{StripeScene, render_stripe},
};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Number of different pictures, each with its own noise and stripe.
const NUM_PICTURES: u32 = 8;
const JPEG_QUALITY: u8 = 90;

/// Layout of the images in the recording.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Payload {
    Raw,
    Jpeg,
}

/// The recorded images: the total number of frames, divided among the cameras.
#[derive(Clone, Copy)]
pub(crate) struct Recording {
    pub(crate) size_px: (u32, u32),
    pub(crate) payload: Payload,
    pub(crate) cameras: &'static [&'static str],
    pub(crate) num_frames: u32,
}

impl Recording {
    /// Writes the bag, its calibration and its parameters into `directory`; returns the request that replays it.
    pub(crate) fn write(&self, directory: &Path) -> anyhow::Result<ReplayRequest> {
        fs::create_dir_all(directory)?;
        let bag = directory.join("recording");
        self.record(&bag)?;
        let (width, height) = self.size_px;
        let calibration = format!(
            "{{type: vertical_incidence, frame_id: laser_plane, image_distance_m: 0.026, object_distance_m: 0.3,
            beta_rad: 0.5236, pixel_pitch_m: 4.8e-6, base_row_px: {}.0, center_column_px: {}.5, height_sign: -1}}",
            height / 2,
            width / 2 - 1,
        );
        fs::write(directory.join("calibration.yaml"), calibration)?;
        let camera = "calibration_file: calibration.yaml, motion: {source: constant, step: 0.0001}";
        let values = match self.cameras {
            [_] => camera.to_owned(),
            cameras => {
                let each: Vec<_> =
                    cameras.iter().map(|name| format!("{name}: {{{camera}}}")).collect();
                format!("cameras: [{}], {}", cameras.join(", "), each.join(", "))
            }
        };
        let parameters = directory.join("parameters.yaml");
        fs::write(&parameters, format!("/**: {{ros__parameters: {{{values}}}}}"))?;
        let mut request = ReplayRequest {
            bags: vec![bag],
            output: directory.join("results"),
            force: true,
            ..ReplayRequest::default()
        };
        request.ros.parameter_files.push(parameters);
        Ok(request)
    }

    /// Returns the file of the bag in `directory`.
    pub(crate) fn file(directory: &Path) -> PathBuf {
        directory.join("recording").join("recording_0.mcap")
    }

    fn record(&self, bag: &Path) -> anyhow::Result<()> {
        let options = RecordOptions { compression: Compression::None, ..RecordOptions::default() };
        let mut recorder = Recorder::create(bag, options)?;
        let (suffix, kind) = match self.payload {
            Payload::Raw => ("", sensor_msgs::Image::TYPE),
            Payload::Jpeg => ("/compressed", sensor_msgs::CompressedImage::TYPE),
        };
        let topic = |name: &&str| {
            let name = format!("/{name}/image_raw{suffix}");
            recorder.add_topic(&Topic::new(name, kind, QosProfile::reliable(10)))
        };
        let topics = self.cameras.iter().map(topic).collect::<Result<Vec<_>, _>>()?;
        let pictures = self.pictures()?;
        let mut bytes = Vec::new();
        for (sequence, picture) in
            (1..=self.num_frames / topics.len() as u32).zip(pictures.iter().cycle())
        {
            let stamp_ns = i64::from(sequence) * 10_000_000;
            self.encode(stamp_ns, picture, &mut bytes)?;
            for &topic in &topics {
                recorder.write(
                    topic,
                    Times { log_ns: stamp_ns, publish_ns: stamp_ns, sequence },
                    &bytes,
                )?;
            }
        }
        recorder.finish()?;
        Ok(())
    }

    fn pictures(&self) -> anyhow::Result<Vec<Vec<u8>>> {
        let (width, height) = self.size_px;
        let scene = StripeScene {
            width,
            height,
            amplitude: 199.0,
            sigma_px: 2.2,
            read_noise: 2.0,
            ..StripeScene::default()
        };
        let picture = |number: u32| {
            let mut samples = Vec::new();
            let centre = |column| {
                0.44 * f64::from(height) + f64::from(3 * number) + 0.05 * f64::from(column)
            };
            render_stripe(&StripeScene { seed: number.into(), ..scene }, centre, &mut samples);
            if self.payload == Payload::Raw {
                return Ok(samples);
            }
            let mut file = Vec::new();
            JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY).encode(
                &samples,
                width,
                height,
                ExtendedColorType::L8,
            )?;
            Ok(file)
        };
        (0..NUM_PICTURES).map(picture).collect()
    }

    fn encode(&self, stamp_ns: i64, data: &[u8], bytes: &mut Vec<u8>) -> anyhow::Result<()> {
        let (width, height) = self.size_px;
        let header = Header { stamp: Time::from_ns(stamp_ns), frame_id: "camera".into() };
        match self.payload {
            Payload::Raw => {
                let (encoding, is_bigendian, step) = ("mono8".into(), 0, width);
                let image = sensor_msgs::Image {
                    header,
                    height,
                    width,
                    encoding,
                    is_bigendian,
                    step,
                    data,
                };
                cdr::encode(&image, bytes)?;
            }
            Payload::Jpeg => {
                let format = "mono8; jpeg compressed ".into();
                cdr::encode(&sensor_msgs::CompressedImage { header, format, data }, bytes)?;
            }
        }
        Ok(())
    }
}
