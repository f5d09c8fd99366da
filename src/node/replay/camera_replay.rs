//! One camera's part of a replay: its parameters, images, worker and results bag.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    bag::{BagReader, RecordError, Topic, place},
    msg::{schema::Message, sensor_msgs::CameraInfo},
    node::{
        ambient_file, calibration_file,
        input::{self, ImageTopic, InputError},
        positions,
        recording::{Description, ResultsBag},
        results::Results,
        run::{Chain, REPLAY_BOUND},
        sink::Outlet,
        static_tf::RecordedTf,
        status::{Reporter, session_id},
        topics,
        worker::{Worker, WorkerOptions},
    },
    ros::{camera_params::CameraParams, names::NodeNames, parameters::Parameters, value::Value},
    scanner::{calibration::Calibration, image::OwnedImage, pipeline::Pipeline},
};

use super::{Replay, ReplayError, stated_positions};

/// A camera that is replayed.
pub(super) struct CameraReplay {
    camera: CameraParams,
    /// The effective parameters of all cameras, as if this were the only one that is replayed.
    values: Parameters,
    calibration: Option<(Calibration, String)>,
    ambient: Option<OwnedImage>,
    pub(super) image_topic: ImageTopic,
    /// Topics with the positions of the frames.
    pub(super) position_topics: Vec<String>,
    /// Topic of the camera's description, if needed and recorded.
    info_topic: Option<String>,
    /// Directory of the results bag.
    output: PathBuf,
}

impl CameraReplay {
    /// Reads the calibration and finds the camera's images in every recording.
    pub(super) fn prepare(
        replay: &Replay,
        camera: CameraParams,
        mut values: Parameters,
        output: PathBuf,
    ) -> Result<Self, ReplayError> {
        let calibration =
            camera.calibration_file.as_deref().map(calibration_file::load).transpose()?;
        let ambient = ambient_file::load(&camera)?;
        let axis = calibration.as_ref().map(|(calibration, _)| calibration);
        // Checked here, before anything is written.
        positions::of_camera(&camera, axis)?;
        let mut image_topic: Option<ImageTopic> = None;
        let mut position_topics = Vec::new();
        for bag in &replay.bags {
            let path = bag.path();
            if bag.has_assumed_stamps() && stated_positions::needs_stamps(&camera) {
                return Err(ReplayError::NoStamps(path.into()));
            }
            let found = choose(path, bag, &replay.names, &camera)?;
            let expected = image_topic.get_or_insert_with(|| found.clone());
            if *expected != found {
                let (expected, found) = (expected.name.clone(), found.name);
                return Err(ReplayError::Mixed { bag: path.into(), found, expected });
            }
            for topic in choose_positions(path, bag, &replay.names, &camera)? {
                if !position_topics.contains(&topic) {
                    position_topics.push(topic);
                }
            }
            place::refuse_same(path, &output).map_err(ReplayError::OutputIsInput)?;
        }
        // Without recordings there are no images.
        let image_topic = image_topic.ok_or_else(|| ReplayError::Input {
            bag: PathBuf::new(),
            source: InputError::NoImages(Vec::new()),
        })?;
        // The recorded effective parameters state the transport that was found, not the default.
        let transport = Value::Text(image_topic.transport.name().to_owned());
        values.set(&camera.full_name("image_transport"), transport, "the recording")?;
        let info_topic = match axis.and_then(Calibration::image_size_px) {
            Some(_) => info_topic(&replay.bags, &replay.names, &camera, &image_topic)?,
            None => None,
        };
        Ok(Self {
            camera,
            values,
            calibration,
            ambient,
            image_topic,
            position_topics,
            info_topic,
            output,
        })
    }

    /// Rejects a camera that uses the same images as another one.
    pub(super) fn refuse_same_images(&self, others: &[Self]) -> Result<(), ReplayError> {
        match others.iter().find(|other| other.image_topic.name == self.image_topic.name) {
            None => Ok(()),
            Some(other) => Err(ReplayError::SameImages {
                first: other.camera.name.clone(),
                second: self.camera.name.clone(),
                topic: self.image_topic.name.clone(),
            }),
        }
    }

    /// Rejects an existing output unless it may be replaced.
    pub(super) fn refuse_existing(&self, replay: &Replay) -> Result<(), RecordError> {
        if !replay.options.force && fs::symlink_metadata(&self.output).is_ok() {
            return Err(RecordError::Exists(self.output.clone()));
        }
        Ok(())
    }

    /// Creates the results bag and the processing chain that writes it.
    pub(super) fn chain(&self, replay: &Replay) -> Result<Chain, ReplayError> {
        let calibration = self.calibration();
        let published = topics::published(&replay.names, &self.camera.name, calibration)?;
        let mut topics = topics::recorded(&published);
        let direction = self.camera.scanner.stripe_direction;
        let static_tf = calibration.and_then(|known| RecordedTf::new(known, direction));
        if static_tf.is_some() {
            topics.push(self.static_tf_topic(replay)?);
        }
        let num_topics = topics.len();
        if replay.request.with_images {
            let side = self.side_topics();
            let inputs = std::iter::once(&self.image_topic.name).chain(&side);
            topics.extend(inputs.filter_map(|name| recorded(name, &replay.bags)));
        }
        let description = self.description(replay);
        let results = ResultsBag::create(&self.output, replay.options, &topics, description)?;
        Ok(Chain {
            topic: self.image_topic.name.clone(),
            worker: self.worker(replay)?.with_static_tf(static_tf),
            outlets: vec![Outlet::replay(Box::new(results))],
            num_topics,
        })
    }

    /// Returns the topic of the laser plane's pose. If the recorded one is written beside it, both have its definition.
    fn static_tf_topic(&self, replay: &Replay) -> Result<Topic, ReplayError> {
        let endpoint = topics::static_tf(&replay.names)?;
        let is_passed = replay.request.with_images && self.side_topics().contains(&endpoint.name);
        let given = recorded(&endpoint.name, &replay.bags).filter(|_| is_passed);
        let own = Topic::new(endpoint.name, endpoint.kind, endpoint.qos);
        Ok(given.filter(|given| given.type_name == own.type_name).unwrap_or(own))
    }

    /// Returns the name of the camera; empty if it is the only one.
    pub(super) fn name(&self) -> &str {
        &self.camera.name
    }

    pub(super) fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref().map(|(calibration, _)| calibration)
    }

    pub(super) fn worker(&self, replay: &Replay) -> Result<Worker, ReplayError> {
        let sha256 = self.values.camera_sha256(&self.camera.name);
        let calibration = self.calibration();
        let part_frame = self.camera.part_frame(calibration);
        let scanner = self.camera.scanner_for(&part_frame);
        let results = Results::new(&scanner, calibration, &sha256).with_part_frame(part_frame);
        let reporter = Reporter {
            node: replay.names.fully_qualified(),
            camera: self.camera.name.clone(),
            session_id: session_id(&self.image_topic.name, &sha256),
            topic: self.image_topic.name.clone(),
            queue_capacity: REPLAY_BOUND.items as u32,
        };
        let options = WorkerOptions {
            transport: self.image_topic.transport,
            max_frame_bytes: self.camera.max_frame_bytes,
            sends_images: replay.request.with_images,
        };
        let mut pipeline =
            Pipeline::new(scanner, calibration.cloned()).with_ambient(self.ambient.clone());
        if self.camera.tracks_laser(calibration) {
            pipeline = pipeline.with_laser_tracked();
        }
        let positions = positions::of_camera(&self.camera, calibration)?;
        positions::missing_axis::warn(&self.camera.scanner.motion, calibration);
        Ok(Worker::new(options, pipeline, results, reporter)
            .with_positions(positions, self.side_topics())
            .with_camera_info(calibration.cloned(), self.info_topic.clone()))
    }

    /// Returns all topics that are read in addition to the images.
    pub(super) fn side_topics(&self) -> Vec<String> {
        self.position_topics.iter().chain(&self.info_topic).cloned().collect()
    }

    pub(super) fn description(&self, replay: &Replay) -> Description {
        Description {
            parameters: self.values.to_yaml(),
            parameters_sha256: self.values.camera_sha256(&self.camera.name),
            inputs: replay.bags.iter().map(|bag| bag.name().to_owned()).collect(),
            input_topic: self.image_topic.name.clone(),
            calibration: self.calibration.as_ref().map(|(_, text)| text.clone()),
        }
    }
}

/// Returns a topic of the recordings by name.
fn recorded(name: &str, bags: &[BagReader]) -> Option<Topic> {
    let mut topics = bags.iter().flat_map(BagReader::topics);
    topics.find(|topic| topic.name == name).map(|topic| (**topic).clone())
}

/// Returns the name and type of every topic of a recording.
fn named(bag: &BagReader) -> Vec<(String, String)> {
    let mut topics: Vec<_> =
        bag.topics().iter().map(|topic| (topic.name.clone(), topic.type_name.clone())).collect();
    // A name and type may occur twice with different QoS.
    topics.dedup();
    topics
}

/// Returns the `CameraInfo` topic: the remapped `camera_info`, else the one next to the images. `None` if not recorded.
fn info_topic(
    bags: &[BagReader],
    names: &NodeNames,
    camera: &CameraParams,
    images: &ImageTopic,
) -> Result<Option<String>, ReplayError> {
    let remapped = names.remapped(&topics::of_camera(&camera.name, "camera_info"));
    let name = match remapped.map_err(InputError::Name) {
        Ok(Some(name)) => name,
        Ok(None) => {
            let base = images.name.strip_suffix("/compressed").unwrap_or(&images.name);
            format!("{}/camera_info", base.rsplit_once('/').map_or("", |(parent, _)| parent))
        }
        Err(source) => return Err(ReplayError::Input { bag: PathBuf::new(), source }),
    };
    let described = recorded(&name, bags);
    let is_info = |topic: &Topic| topic.type_name == CameraInfo::TYPE.name;
    match described.filter(is_info) {
        Some(topic) => {
            topic.require_cdr()?;
            Ok(Some(name))
        }
        None => Ok(None),
    }
}

fn choose_positions(
    path: &Path,
    bag: &BagReader,
    names: &NodeNames,
    camera: &CameraParams,
) -> Result<Vec<String>, ReplayError> {
    let source = camera.scanner.motion.source;
    let chosen = positions::topics::choose(&named(bag), names, &camera.name, source)
        .map_err(|source| ReplayError::Positions { bag: path.to_owned(), source })?;
    for topic in bag.topics().iter().filter(|topic| chosen.contains(&topic.name)) {
        topic.require_cdr()?;
    }
    Ok(chosen)
}

fn choose(
    path: &Path,
    bag: &BagReader,
    names: &NodeNames,
    camera: &CameraParams,
) -> Result<ImageTopic, ReplayError> {
    let chosen = input::choose(&named(bag), names, &camera.name, camera.chosen_transport())
        .map_err(|source| ReplayError::Input { bag: path.to_owned(), source })?;
    for topic in bag.topics().iter().filter(|topic| topic.name == chosen.name) {
        topic.require_cdr()?;
    }
    Ok(chosen)
}
