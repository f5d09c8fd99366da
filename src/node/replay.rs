//! A replay from its request to its results: opens, checks and connects everything before the first frame is read.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::{
    bag::{
        self, BagError, BagReader, Filter, ReadOptions, RecordError, RecordOptions, Topic, place,
        player::{Pacer, RateError},
    },
    ros::{
        arguments::RosArguments,
        camera_params::CameraParams,
        names::{NameError, NodeNames},
        node_params::{Compression, NodeParams},
        parameters::{ParameterError, Parameters},
        value::Value,
    },
    scanner::{calibration::Calibration, image::OwnedImage, pipeline::Pipeline},
};

use super::{
    ambient_file::{self, AmbientFileError},
    calibration_file::{self, CalibrationFileError},
    camera::{self, CameraError},
    input::{self, ImageTopic, InputError},
    player::BagPlayer,
    recording::{Description, ResultsBag},
    results::Results,
    run::{INPUT_BOUND, Run, RunError},
    sink::Outlet,
    statistics::Summary,
    status::{Reporter, session_id},
    stop::Stop,
    topics,
    worker::{Worker, WorkerOptions},
};

/// Name of the node before remapping.
pub const NODE_NAME: &str = "laser_profiler";

/// What shares a record with the largest frame: its header and the chunk's other messages.
const RECORD_MARGIN_BYTES: usize = 16 << 20;

/// What to replay, and how.
#[derive(Clone, Debug, Default)]
pub struct ReplayRequest {
    /// Recordings, played one after another.
    pub bags: Vec<PathBuf>,
    /// The results' bag.
    pub output: PathBuf,
    /// Times the speed of the recording; `None`: as fast as possible.
    pub rate: Option<f64>,
    /// Whether an existing results bag is replaced.
    pub force: bool,
    /// Whether the input images go into the results' bag too.
    pub with_images: bool,
    /// The camera whose images are replayed, where the parameters name several.
    pub camera: Option<String>,
    /// Names, remaps and parameters.
    pub ros: RosArguments,
}

/// Why a replay cannot start, or could not end.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// A name or remap rule.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter or parameter file.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Which camera of the parameters to take.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The rate.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// Which topic to take.
    #[error("{}: {source}", bag.display())]
    Input {
        /// The recording.
        bag: PathBuf,
        /// Why none can be taken.
        source: InputError,
    },
    /// Recordings with different image topics.
    #[error("{} has its images on {found}, but the recording before on {expected}: replay them one by one", bag.display())]
    Mixed {
        /// The recording.
        bag: PathBuf,
        /// Its image topic.
        found: String,
        /// That of the recordings before.
        expected: String,
    },
    /// Results would replace their own input.
    #[error("{0}; choose another output")]
    OutputIsInput(io::Error),
    /// The calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationFileError),
    /// The frame without laser.
    #[error(transparent)]
    Ambient(#[from] AmbientFileError),
    /// A recording cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// The results cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// It began, but did not reach its end.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl ReplayError {
    /// Whether what was asked for is to blame, rather than a file or the machine.
    pub const fn is_usage(&self) -> bool {
        match self {
            Self::Input { source, .. } => source.is_usage(),
            Self::Bag(_)
            | Self::Run(_)
            | Self::Record(_)
            | Self::Calibration(CalibrationFileError::Io { .. })
            | Self::Ambient(AmbientFileError::Io { .. }) => false,
            _ => true,
        }
    }
}

/// A replay that can begin: all that was asked for is there and fits.
pub struct Replay {
    request: ReplayRequest,
    names: NodeNames,
    values: Parameters,
    compression: Compression,
    camera: CameraParams,
    calibration: Option<(Calibration, String)>,
    ambient: Option<OwnedImage>,
    bags: Vec<BagReader>,
    image_topic: ImageTopic,
}

impl Replay {
    /// Reads the parameters and the calibration, opens the recordings and chooses their image topic.
    ///
    /// # Errors
    /// The first thing that is not as it should be; nothing has been written then.
    pub fn prepare(request: ReplayRequest) -> Result<Self, ReplayError> {
        request.rate.map(Pacer::new).transpose()?;
        let names = NodeNames::new(NODE_NAME, &request.ros.remaps)?;
        let mut values = Parameters::load(&names, &request.ros)?;
        let NodeParams { cameras, recording, .. } = NodeParams::new(&values)?;
        let bags = open(&request, &cameras)?;
        let camera = camera::choose(cameras, request.camera.as_deref(), &bags, &names)?;
        let calibration =
            camera.calibration_file.as_deref().map(calibration_file::load).transpose()?;
        let ambient = ambient_file::load(&camera)?;
        let mut image_topic: Option<ImageTopic> = None;
        for (path, bag) in request.bags.iter().zip(&bags) {
            let found = choose(path, bag, &names, &camera)?;
            let expected = image_topic.get_or_insert_with(|| found.clone());
            if *expected != found {
                let (expected, found) = (expected.name.clone(), found.name);
                return Err(ReplayError::Mixed { bag: path.clone(), found, expected });
            }
            place::refuse_same(path, &request.output).map_err(ReplayError::OutputIsInput)?;
        }
        // Without any recording there is nothing to choose from.
        let image_topic = image_topic.ok_or_else(|| ReplayError::Input {
            bag: PathBuf::new(),
            source: InputError::NoImages(Vec::new()),
        })?;
        // What is recorded as effective is what was done, not the default that gave way.
        let transport = Value::Text(image_topic.transport.name().to_owned());
        values.set(&camera.full_name("image_transport"), transport, "the recording")?;
        let compression = recording.compression;
        Ok(Self {
            request,
            names,
            values,
            compression,
            camera,
            calibration,
            ambient,
            bags,
            image_topic,
        })
    }

    /// The topic that is taken.
    pub const fn image_topic(&self) -> &ImageTopic {
        &self.image_topic
    }

    /// How many messages will come, as far as the recordings know.
    pub fn num_messages(&self) -> Option<u64> {
        let of_bag =
            |bag: &BagReader| bag.message_counts()?.get(self.image_topic.name.as_str()).copied();
        self.bags.iter().map(of_bag).try_fold(0, |sum: u64, count| Some(sum.saturating_add(count?)))
    }

    /// Replays to the end, or until `stop` is raised. `on_message` hears how many messages were read.
    ///
    /// # Errors
    /// The results cannot be written; what was written before stays readable.
    pub fn run(self, stop: &Stop, on_message: &mut dyn FnMut(u64)) -> Result<Summary, ReplayError> {
        let filter = Filter::topics([self.image_topic.name.as_str()]);
        let messages: Vec<_> = self.bags.iter().map(|bag| bag.messages(&filter)).collect();
        let mut player = BagPlayer::new(messages, self.request.rate, stop.clone())?;

        let calibration = self.calibration.as_ref().map(|(calibration, _)| calibration);
        let published = topics::published(&self.names, &self.camera.name, calibration)?;
        let mut topics = topics::recorded(&published);
        let num_topics = topics.len();
        if self.request.with_images {
            topics.extend(self.input_topic());
        }
        let options = RecordOptions {
            compression: match self.compression {
                Compression::Zstd => bag::Compression::Zstd,
                Compression::Lz4 => bag::Compression::Lz4,
                Compression::None => bag::Compression::None,
            },
            force: self.request.force,
        };
        let description = self.description();
        let results = ResultsBag::create(&self.request.output, &options, &topics, description)?;
        let run = Run {
            source: &mut player,
            worker: self.worker(),
            outlets: vec![Outlet::replay(Box::new(results))],
            num_topics,
            stop,
            on_message,
        };
        Ok(run.replay()?)
    }

    fn worker(&self) -> Worker {
        let sha256 = self.values.camera_sha256(&self.camera.name);
        let calibration = self.calibration.as_ref().map(|(calibration, _)| calibration);
        let frame_id = calibration.map_or("", Calibration::frame_id);
        let scanner = self.camera.scanner_for(frame_id);
        let results = Results::new(&scanner, calibration, &sha256);
        let reporter = Reporter {
            node: self.names.fully_qualified(),
            camera: self.camera.name.clone(),
            session_id: session_id(&self.image_topic.name, &sha256),
            topic: self.image_topic.name.clone(),
            queue_capacity: INPUT_BOUND.items as u32,
        };
        let options = WorkerOptions {
            transport: self.image_topic.transport,
            max_frame_bytes: self.camera.max_frame_bytes,
            sends_images: self.request.with_images,
        };
        let pipeline =
            Pipeline::new(scanner, calibration.cloned()).with_ambient(self.ambient.clone());
        Worker::new(options, pipeline, results, reporter)
    }

    fn description(&self) -> Description {
        let name = |path: &PathBuf| {
            path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
        };
        Description {
            parameters: self.values.to_yaml(),
            parameters_sha256: self.values.camera_sha256(&self.camera.name),
            inputs: self.request.bags.iter().map(name).collect(),
            input_topic: self.image_topic.name.clone(),
            calibration: self.calibration.as_ref().map(|(_, text)| text.clone()),
        }
    }

    fn input_topic(&self) -> Option<Topic> {
        let mut topics = self.bags.iter().flat_map(BagReader::topics);
        topics.find(|topic| topic.name == self.image_topic.name).map(|topic| (**topic).clone())
    }
}

/// Opens the recordings for frames as large as any of the cameras may have.
fn open(request: &ReplayRequest, cameras: &[CameraParams]) -> Result<Vec<BagReader>, ReplayError> {
    let max_frame_bytes = cameras.iter().map(|camera| camera.max_frame_bytes).max();
    let options = ReadOptions {
        record_limit_bytes: max_frame_bytes.unwrap_or(0) as usize + RECORD_MARGIN_BYTES,
        ..ReadOptions::default()
    };
    let open = |path: &PathBuf| {
        let bag = BagReader::open(path, &options)?;
        bag.notes().iter().for_each(|note| tracing::warn!("{note}"));
        Ok(bag)
    };
    request.bags.iter().map(open).collect()
}

fn choose(
    path: &Path,
    bag: &BagReader,
    names: &NodeNames,
    camera: &CameraParams,
) -> Result<ImageTopic, ReplayError> {
    let mut topics: Vec<_> =
        bag.topics().iter().map(|topic| (topic.name.clone(), topic.type_name.clone())).collect();
    // One name and type may stand there twice, with different QoS.
    topics.dedup();
    let chosen = input::choose(&topics, names, &camera.name, camera.image_transport)
        .map_err(|source| ReplayError::Input { bag: path.to_owned(), source })?;
    for topic in bag.topics().iter().filter(|topic| topic.name == chosen.name) {
        topic.require_cdr()?;
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests;
