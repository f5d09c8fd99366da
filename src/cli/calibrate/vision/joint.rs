//! Positions of the pictures: of a joint or an encoder in a recording, from a table, or by a constant step.

use std::{collections::BTreeMap, path::Path};

use anyhow::{anyhow, bail, ensure};

use super::{args::AxisArgs, pictures::Pictures};
use crate::{
    bag::{RawMessage, pictures::stated_positions},
    cli::settings,
    msg::{cdr, laser_profiler_msgs::EncoderStamped, schema::Message, sensor_msgs::JointState},
    scanner::{motion::counter::Counter, params::MotionParams},
};

/// Source of the pictures' positions.
pub(super) enum Source {
    /// Constant motion from picture to picture, radians or metres.
    Step(f64),
    /// Positions by the names of picture files.
    Table(BTreeMap<String, f64>),
    /// Messages on a topic.
    Topic(String),
}

/// Positions as a function of time.
pub(super) struct Joint {
    name: Option<String>,
    /// Counter of an encoder.
    counter: Counter,
    /// Metres or radians per count; 0: as stated in the messages.
    count_scale: Option<f64>,
    stated: Vec<(i64, f64)>,
}

/// Returns the source of positions that `args` select.
///
/// # Errors
/// [`Usage`](crate::cli::Usage): no topic, or several. A table that cannot be read.
pub(super) fn source(args: &AxisArgs, pictures: &Pictures) -> anyhow::Result<Source> {
    if let Some(step) = args.step {
        return Ok(Source::Step(step));
    }
    if let Some(table) = &args.positions {
        return Ok(Source::Table(stated_positions(table)?));
    }
    let mut topics = pictures.topics_of(JointState::TYPE.name);
    topics.extend(pictures.topics_of(EncoderStamped::TYPE.name));
    match (&args.joint_topic, topics.as_slice()) {
        (Some(wanted), _) if topics.contains(wanted) => Ok(Source::Topic(wanted.clone())),
        (None, [only]) => Ok(Source::Topic(only.clone())),
        (Some(wanted), _) => Err(settings::usage(format!(
            "no positions on {wanted}; topics of sensor_msgs/msg/JointState and laser_profiler_msgs/msg/EncoderStamped: {}",
            listed(&topics)
        ))),
        (None, []) => Err(settings::usage(
            "no positions: the recording has no topic of sensor_msgs/msg/JointState or laser_profiler_msgs/msg/EncoderStamped. \
             --step gives the motion from picture to picture, --positions a table of the pictures' positions",
        )),
        (None, _) => {
            Err(settings::usage(format!("--joint-topic must name one of {}", listed(&topics))))
        }
    }
}

impl Source {
    /// Returns the position of a picture by its name or its number, if messages do not state it.
    pub(super) fn of_picture(&self, name: &str, number: usize) -> Option<f64> {
        match self {
            Self::Step(step) => Some(step * number as f64),
            Self::Table(positions) => {
                let file = Path::new(name).file_name()?.to_string_lossy();
                positions.get(&*file).or_else(|| positions.get(name)).copied()
            }
            Self::Topic(_) => None,
        }
    }
}

fn listed(topics: &[String]) -> String {
    if topics.is_empty() { "none".to_owned() } else { topics.join(", ") }
}

impl Joint {
    /// Creates an empty list of positions, for the named joint, the only joint, or an encoder whose counts are
    /// interpreted as in the node.
    pub(super) fn new(name: Option<String>, motion: &MotionParams) -> Self {
        let counter = Counter::new(motion.encoder_bits);
        Self { name, counter, count_scale: motion.scale, stated: Vec::new() }
    }

    /// Adds a message.
    ///
    /// # Errors
    /// The message is neither a joint state nor an encoder sample, or it has no position of the axis.
    pub(super) fn take(&mut self, message: &RawMessage) -> anyhow::Result<()> {
        if message.topic.type_name == EncoderStamped::TYPE.name {
            return self.take_counts(message);
        }
        let state: JointState<'_> = cdr::decode(&message.data)?;
        let at = match &self.name {
            Some(name) => state.name.iter().position(|named| named == name),
            None if state.position.len() == 1 => Some(0),
            None => None,
        };
        let position = at.and_then(|at| state.position.get(at)).copied();
        let Some(position) = position.filter(|position| position.is_finite()) else {
            let joints = state.name.join(", ");
            return match &self.name {
                Some(name) => bail!("no position of the joint {name} among {joints}"),
                None => Err(anyhow!("--joint must name one of {joints}")),
            };
        };
        self.stated.push((state.header.stamp.to_ns(), position));
        Ok(())
    }

    fn take_counts(&mut self, message: &RawMessage) -> anyhow::Result<()> {
        let sample: EncoderStamped<'_> = cdr::decode(&message.data)?;
        ensure!(sample.error == 0, "the encoder reports error bits {:#x}", sample.error);
        let scale = self.count_scale.unwrap_or(sample.scale);
        ensure!(
            scale != 0.0 && scale.is_finite(),
            "the encoder's scale is {scale} m per count, which is not valid: set motion.scale (-p motion.scale:=1e-6)"
        );
        let counts = self.counter.unwrap(sample.counts);
        self.stated.push((sample.header.stamp.to_ns(), counts as f64 * scale));
        Ok(())
    }

    /// Sorts the messages by time.
    pub(super) fn settle(&mut self) {
        self.stated.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    }

    /// Returns the position at a time, linear between two messages; `None` outside of them.
    pub(super) fn at(&self, stamp_ns: i64) -> Option<f64> {
        let after = self.stated.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let &(end_ns, end) = self.stated.get(after)?;
        if end_ns == stamp_ns {
            return Some(end);
        }
        let &(start_ns, start) = self.stated.get(after.checked_sub(1)?)?;
        let share = (stamp_ns - start_ns) as f64 / (end_ns - start_ns) as f64;
        Some(start + share * (end - start))
    }

    /// Returns true if no position was stated.
    pub(super) fn is_empty(&self) -> bool {
        self.stated.is_empty()
    }
}
