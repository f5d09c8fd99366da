//! Converts messages about an axis to samples.

use super::{Known, MAX_NAMED, Positions};
use crate::{
    bag::RawMessage,
    msg::{
        cdr, laser_profiler_msgs::EncoderStamped, schema::Message, sensor_msgs::JointState,
        tf2_msgs::TFMessage,
    },
    scanner::{
        axis::{AxisKind, AxisTravel, RawPosition},
        motion::{
            frames::Stated,
            reading::{Reading, unrolled},
        },
    },
};

/// Topic of static poses.
pub(super) const STATIC_TF: &str = "/tf_static";

impl Positions {
    /// Result of processing a message; `Err` holds the reason for refusal.
    pub(super) fn take_joint(&mut self, message: &RawMessage) -> Result<(), String> {
        let state: JointState<'_> = decoded(message)?;
        self.note_joints(&state.name);
        let Some(index) = self.index_of_joint(&state)? else { return Ok(()) };
        let Some(&raw) = state.position.get(index) else {
            let (positions, names) = (state.position.len(), state.name.len());
            return Err(format!("{positions} positions for {names} names"));
        };
        let scale = self.params.scale.unwrap_or(1.0);
        let position = raw * scale;
        if !position.is_finite() {
            return Err(format!("the position is {raw}"));
        }
        let stamp_ns = state.header.stamp.to_ns();
        self.push(stamp_ns, message.log_time_ns, position, 0)
    }

    /// Finds the joint of the axis; `None` if the message is about another axis.
    fn index_of_joint(&self, state: &JointState<'_>) -> Result<Option<usize>, String> {
        let wanted = &self.moved.joint;
        if !wanted.is_empty() {
            return Ok(state.name.iter().position(|name| name == wanted));
        }
        match (state.name.len(), self.joints.len()) {
            (0 | 1, 0 | 1) => Ok(Some(0)),
            _ => Err(format!(
                "there are several joints, and motion.joint does not select one: {}",
                self.joints.join(", ")
            )),
        }
    }

    fn note_joints(&mut self, names: &[String]) {
        for name in names {
            if self.joints.len() < MAX_NAMED && !self.joints.contains(name) {
                self.joints.push(name.clone());
            }
        }
    }

    pub(super) fn take_encoder(&mut self, message: &RawMessage) -> Result<(), String> {
        let sample: EncoderStamped<'_> = decoded(message)?;
        if sample.error != 0 {
            return Err(format!("the encoder reports error bits {:#x}", sample.error));
        }
        let scale = self.params.scale.unwrap_or(sample.scale);
        if scale == 0.0 || !scale.is_finite() {
            return Err(format!(
                "its scale is {scale} m per count, which is invalid: set motion.scale"
            ));
        }
        // Samples before and after would be in different units.
        let first = *self.scale.get_or_insert(scale);
        if first.to_bits() != scale.to_bits() {
            return Err(format!("its scale is {scale} m per count, but was {first} before"));
        }
        let counts = self.counter.unwrap(sample.counts);
        let stamp_ns = sample.header.stamp.to_ns();
        let position = counts as f64 * scale;
        self.push(stamp_ns, message.log_time_ns, position, counts)
    }

    fn push(
        &mut self,
        stamp_ns: i64,
        received_ns: i64,
        mut raw: f64,
        counts: i64,
    ) -> Result<(), String> {
        if let (Known::Axis(track), AxisKind::Revolute) = (&self.known, self.kind) {
            raw = unrolled(raw, track.last().map(|(_, last)| last.position.0));
        }
        let position = RawPosition(raw);
        let reading = Reading { position, travel: self.travel(position), counts };
        let Known::Axis(track) = &mut self.known else { return Ok(()) };
        let was_set_back =
            track.push(stamp_ns, received_ns, reading).map_err(|refused| refused.to_string())?;
        if was_set_back {
            tracing::warn!(
                "the axis's clock was set back to {stamp_ns} ns: earlier samples are discarded"
            );
        }
        self.note_arrival(stamp_ns, received_ns);
        Ok(())
    }

    /// Returns the travel of a joint or an encoder; without a calibrated axis its positions are metres or radians.
    fn travel(&self, position: RawPosition) -> AxisTravel {
        match (&self.axis, self.kind) {
            (Some(axis), _) => axis.travel(position),
            (None, AxisKind::Prismatic) => AxisTravel::Metres(position.0),
            (None, AxisKind::Revolute) => AxisTravel::Radians(position.0),
        }
    }

    pub(super) fn take_frames(&mut self, message: &RawMessage) -> Result<(), String> {
        let poses: TFMessage<'_> = decoded(message)?;
        let Known::Frames(tree) = &mut self.known else { return Ok(()) };
        let (mut refusal, mut latest_ns) = (None, i64::MIN);
        for pose in &poses.transforms {
            let (origin, rotation) = (pose.transform.translation, pose.transform.rotation);
            let stamp_ns = pose.header.stamp.to_ns();
            let taken = tree.take(&Stated {
                parent: &pose.header.frame_id,
                child: &pose.child_frame_id,
                stamp_ns,
                received_ns: message.log_time_ns,
                origin_m: [origin.x, origin.y, origin.z],
                rotation: [rotation.x, rotation.y, rotation.z, rotation.w],
                is_static: message.topic.is_latched() || message.topic.name.ends_with(STATIC_TF),
            });
            match taken {
                Ok(()) => latest_ns = latest_ns.max(stamp_ns),
                // The other poses of the message may be valid.
                Err(error) => refusal = Some(error.to_string()),
            }
        }
        let is_awaited = match (&self.known, self.given_up) {
            (Known::Frames(tree), Some((time_ns, _))) => tree.has_reached(self.frames(), time_ns),
            _ => false,
        };
        if is_awaited {
            self.note_arrival(latest_ns, message.log_time_ns);
        }
        refusal.map_or(Ok(()), Err)
    }
}

fn decoded<'a, T>(message: &'a RawMessage) -> Result<T, String>
where
    T: Message + serde::Deserialize<'a>,
{
    if message.topic.type_name != T::TYPE.name {
        return Err(format!(
            "the message is a {}, not a {}",
            message.topic.type_name,
            T::TYPE.name
        ));
    }
    cdr::decode(&message.data).map_err(|error| error.to_string())
}
