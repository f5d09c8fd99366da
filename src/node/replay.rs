//! Prepares and runs a replay. Opens and checks all inputs before the first frame is read.

mod camera_replay;
mod stages;
mod stated_positions;

use std::{io, path::PathBuf};

use thiserror::Error;

use crate::{
    bag::{
        self, BagError, BagReader, Filter, PictureOptions, ReadOptions, RecordError, RecordOptions,
        pictures,
        player::{Pacer, RateError},
    },
    ros::{
        arguments::RosArguments,
        camera_params::CameraParams,
        names::{NameError, NodeNames},
        node_params::{Compression, NodeParams},
        parameters::{ParameterError, Parameters},
    },
};

use super::{
    ambient_file::AmbientFileError,
    calibration_file::CalibrationFileError,
    camera::{self, CameraError},
    input::{ImageTopic, InputError},
    player::BagPlayer,
    positions::{AxisError, topics::PositionTopicError},
    run::{Run, RunError},
    statistics::Summary,
    stop::Stop,
};
use camera_replay::CameraReplay;
pub(crate) use stages::Stage;

/// Name of the node before remapping.
pub(crate) const NODE_NAME: &str = "laser_profiler";

/// The request for a replay.
#[derive(Clone, Debug, Default)]
pub struct ReplayRequest {
    /// Recordings, folders of pictures, pictures and patterns, played one after another.
    pub bags: Vec<PathBuf>,
    /// Stamps and positions of pictures.
    pub pictures: PictureOptions,
    /// Results bag; with several cameras, the directory of their bags, each named after its camera.
    pub output: PathBuf,
    /// Rate relative to the recorded speed; `None` for as fast as possible.
    pub rate: Option<f64>,
    /// True if an existing results bag is replaced.
    pub force: bool,
    /// True if the input images are also stored in the results bag.
    pub with_images: bool,
    /// Camera to replay if the parameters name several; `None` for all whose images are recorded.
    pub camera: Option<String>,
    /// Names, remaps and parameters.
    pub ros: RosArguments,
}

/// The reason that a replay cannot start or complete.
#[derive(Debug, Error)]
pub(crate) enum ReplayError {
    /// A name or remap rule is invalid.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter or parameter file is invalid.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// No camera can be chosen.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The rate is invalid.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// No image topic can be chosen.
    #[error("{}: {source}", bag.display())]
    Input {
        /// The recording.
        bag: PathBuf,
        /// The reason that no topic can be chosen.
        source: InputError,
    },
    /// The recordings have different image topics.
    #[error("{} has its images on {found}, but the recordings before it on {expected}: replay them one by one", bag.display())]
    Mixed {
        /// The recording.
        bag: PathBuf,
        /// Its image topic.
        found: String,
        /// Image topic of the preceding recordings.
        expected: String,
    },
    /// Two cameras use the same images.
    #[error(
        "the cameras {first} and {second} both take {topic}: replay them one by one, with --camera NAME"
    )]
    SameImages {
        /// A camera.
        first: String,
        /// Another camera.
        second: String,
        /// The image topic of both.
        topic: String,
    },
    /// A velocity needs times that nothing states.
    #[error(
        "{}: motion.velocity multiplies the time between pictures, which is unknown: give --frame-rate HZ or a file of \
         stamps with --positions FILE.csv, or set motion.step for triggered pictures",
        .0.display()
    )]
    NoStamps(PathBuf),
    /// The results would replace their own input.
    #[error("{0}; choose another output")]
    OutputIsInput(io::Error),
    /// The calibration cannot be loaded.
    #[error(transparent)]
    Calibration(#[from] CalibrationFileError),
    /// Motion parameters and calibration contradict each other.
    #[error(transparent)]
    Axis(#[from] AxisError),
    /// No position topic can be chosen.
    #[error("{}: {source}", bag.display())]
    Positions {
        /// The recording.
        bag: PathBuf,
        /// The reason that no topic can be chosen.
        source: PositionTopicError,
    },
    /// The frame without laser cannot be loaded.
    #[error(transparent)]
    Ambient(#[from] AmbientFileError),
    /// A recording cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// The results cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The run started but failed.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl ReplayError {
    /// True if the request is wrong, rather than a file or the machine.
    pub(crate) const fn is_usage(&self) -> bool {
        match self {
            Self::Input { source, .. } => source.is_usage(),
            Self::Bag(BagError::Pictures(error)) => error.is_usage(),
            Self::Bag(_)
            | Self::Run(_)
            | Self::Record(_)
            | Self::Calibration(CalibrationFileError::Io { .. })
            | Self::Ambient(AmbientFileError::Io { .. }) => false,
            _ => true,
        }
    }
}

/// A replay that is ready to run: all inputs exist and are consistent.
pub(crate) struct Replay {
    request: ReplayRequest,
    names: NodeNames,
    options: RecordOptions,
    bags: Vec<BagReader>,
    cameras: Vec<CameraReplay>,
}

impl Replay {
    /// Reads the parameters and the calibrations, opens the recordings and chooses the cameras and their image topics.
    ///
    /// # Errors
    /// The first invalid input; nothing has been written.
    pub(crate) fn prepare(request: ReplayRequest) -> Result<Self, ReplayError> {
        let (mut replay, values) = Self::open(request)?;
        replay.measure_by(&values)?;
        Ok(replay)
    }

    /// Reads the parameters and opens the recordings; no camera is chosen yet.
    ///
    /// # Errors
    /// A name, a parameter or a recording is invalid.
    pub(crate) fn open(request: ReplayRequest) -> Result<(Self, Parameters), ReplayError> {
        request.rate.map(Pacer::new).transpose()?;
        let names = NodeNames::new(NODE_NAME, &request.ros.remaps)?;
        let mut values = Parameters::load(&names, &request.ros)?;
        let NodeParams { cameras, recording, .. } = NodeParams::new(&values)?;
        let options = RecordOptions {
            compression: match recording.compression {
                Compression::Zstd => bag::Compression::Zstd,
                Compression::Lz4 => bag::Compression::Lz4,
                Compression::None => bag::Compression::None,
            },
            force: request.force,
        };
        let bags = open(&request, &cameras)?;
        stated_positions::apply(&bags, &cameras, &mut values)?;
        Ok((Self { request, names, options, bags, cameras: Vec::new() }, values))
    }

    /// Chooses the cameras and their image topics by these parameters, and reads their calibrations. Changes nothing on
    /// failure.
    ///
    /// # Errors
    /// The first invalid input.
    pub(crate) fn measure_by(&mut self, values: &Parameters) -> Result<(), ReplayError> {
        let cameras = NodeParams::new(values)?.cameras;
        let camera = self.request.camera.as_deref();
        let chosen = camera::choose(cameras, camera, &self.bags, &self.names)?;
        let is_only = chosen.len() == 1;
        let mut prepared = Vec::new();
        for camera in chosen {
            let output = &self.request.output;
            let output = if is_only { output.clone() } else { output.join(&camera.name) };
            let camera = CameraReplay::prepare(self, camera, values.clone(), output)?;
            camera.refuse_same_images(&prepared)?;
            prepared.push(camera);
        }
        self.cameras = prepared;
        Ok(())
    }

    /// Returns the chosen image topics, one per camera.
    pub(crate) fn image_topics(&self) -> impl Iterator<Item = &ImageTopic> {
        self.cameras.iter().map(|camera| &camera.image_topic)
    }

    /// Returns the position topics of all cameras.
    pub(crate) fn position_topics(&self) -> impl Iterator<Item = &str> {
        self.cameras.iter().flat_map(|camera| &camera.position_topics).map(String::as_str)
    }

    /// Returns the number of messages according to the recordings; `None` if unknown.
    pub(crate) fn num_messages(&self) -> Option<u64> {
        let of_bag = |bag: &BagReader| {
            let counts = bag.message_counts()?;
            let mut topics = self.image_topics();
            topics.try_fold(0, |sum: u64, topic| {
                Some(sum.saturating_add(*counts.get(topic.name.as_str())?))
            })
        };
        self.bags.iter().map(of_bag).try_fold(0, |sum: u64, count| Some(sum.saturating_add(count?)))
    }

    /// Replays to the end or until `stop` is raised. Calls `on_message` with the number of messages read.
    ///
    /// # Errors
    /// The results cannot be written; earlier results stay readable.
    pub(crate) fn run(
        self,
        stop: &Stop,
        on_message: &mut dyn FnMut(u64),
    ) -> Result<Summary, ReplayError> {
        let images = self.image_topics().map(|topic| topic.name.as_str());
        let side: Vec<_> = self.cameras.iter().flat_map(CameraReplay::side_topics).collect();
        let filter = Filter::topics(images.chain(side.iter().map(String::as_str)));
        let messages: Vec<_> = self.bags.iter().map(|bag| bag.messages(&filter)).collect();
        let mut player = BagPlayer::new(messages, self.request.rate, stop.clone())?;
        // A failed sink must not affect the results of other cameras.
        self.cameras.iter().try_for_each(|camera| camera.refuse_existing(&self))?;
        let chains = self.cameras.iter().map(|camera| camera.chain(&self));
        let chains = chains.collect::<Result<_, _>>()?;
        Ok(Run { source: &mut player, chains, stop, on_message }.replay()?)
    }
}

/// Opens the recordings with the frame size limit of the largest camera.
fn open(request: &ReplayRequest, cameras: &[CameraParams]) -> Result<Vec<BagReader>, ReplayError> {
    let max_frame_bytes = cameras.iter().map(|camera| camera.max_frame_bytes).max();
    let options = ReadOptions::for_frames(max_frame_bytes.unwrap_or(0));
    let bags = pictures::open_all(&request.bags, &options, &request.pictures)?;
    for note in bags.iter().flat_map(BagReader::notes) {
        tracing::warn!("{note}");
    }
    Ok(bags)
}

#[cfg(test)]
mod tests;
