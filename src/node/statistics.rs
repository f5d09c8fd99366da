//! Counters and stage times: every frame ends in exactly one bin.

mod classes;
mod failures;
mod no_stripes;

use std::time::Duration;

pub(crate) use classes::Classes;
pub(crate) use failures::Failures;
pub(crate) use no_stripes::NoStripes;

use super::histogram::Histogram;
use crate::scanner::params::Channel;

/// Counters of one stream. `received = processed + dropped_overload + rejected`, always.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that arrived.
    pub(crate) received: u64,
    /// Frames that were measured.
    pub processed: u64,
    /// Frames that the full queue dropped.
    pub(crate) dropped_overload: u64,
    /// Frames with an invalid size, step, encoding or CDR.
    pub(crate) malformed: u64,
    /// Frames with the stamp of the previous frame.
    pub(crate) duplicate: u64,
    /// Frames with a stamp before the last one.
    pub(crate) out_of_order: u64,
    /// Frames missing from the middleware's sequence numbers.
    pub(crate) lost_transport: u64,
    /// Points of all centrelines.
    pub(crate) points: u64,
    /// Slices published.
    pub(crate) slices: u64,
    /// Messages that a recorder's full queue dropped.
    pub(crate) recorder_dropped: u64,
    /// Results that the middleware's full queue dropped.
    pub(crate) unpublished: u64,
    /// Bytes handed to the recorder.
    pub(crate) recorder_bytes: u64,
    /// Frames measured without their other exposure although exposures alternate, including the first frame.
    pub(crate) unpaired: u64,
    /// Frames whose measured position was known.
    pub(crate) located: u64,
    /// Frames without a known position, which are not in the scan.
    pub(crate) unlocated: u64,
    /// Frames whose position is in doubt.
    pub(crate) doubtful: u64,
    /// Profiles of scans that lie where the one before lies: without a motion there is no surface.
    pub(crate) standing: u64,
    /// Position messages that could not be used.
    pub(crate) positions_refused: u64,
    /// Frames with too many pixels above the segment threshold for a stripe.
    pub(crate) flooded: u64,
    /// Points of profiles outside the calibrated volume.
    pub(crate) outside_calibration: u64,
    /// Points with a sample at full scale.
    pub(crate) saturated: u64,
    /// Frames by the channel that `channel: auto` stands for.
    pub(crate) chosen: ChosenChannels,
    /// Frames without a stripe.
    pub(crate) no_stripe: NoStripes,
    /// Times that the stamps began again, as those of a recording in a loop do.
    pub(crate) begun_again: u64,
    /// Frames whose stamp is too far from the time of their result to give a latency.
    pub(crate) not_of_now: u64,
    /// Share of speckle and texture in the uncertainty of each frame, pixels.
    pub(crate) texture_px: Classes,
    /// Median uncertainty from noise of each frame, pixels.
    pub(crate) noise_px: Classes,
}

/// Colour frames measured with `channel: auto`, by the channel that was chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ChosenChannels {
    gray: u64,
    red: u64,
    green: u64,
    blue: u64,
}

impl ChosenChannels {
    /// Counts a frame.
    pub(crate) const fn count(&mut self, channel: Channel) {
        match channel {
            Channel::Gray => self.gray += 1,
            Channel::Red => self.red += 1,
            Channel::Green => self.green += 1,
            Channel::Blue => self.blue += 1,
            _ => {}
        }
    }

    /// Returns the channels that were chosen, with their frames.
    pub(crate) fn named(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
        let Self { gray, red, green, blue } = *self;
        [("gray", gray), ("red", red), ("green", green), ("blue", blue)]
            .into_iter()
            .filter(|(_, frames)| *frames > 0)
    }

    const fn add(&mut self, other: &Self) {
        self.gray += other.gray;
        self.red += other.red;
        self.green += other.green;
        self.blue += other.blue;
    }
}

impl Counts {
    /// Frames that arrived and were rejected.
    pub(crate) const fn rejected(&self) -> u64 {
        self.malformed + self.duplicate + self.out_of_order
    }

    /// Frames that never arrived.
    pub(crate) const fn lost(&self) -> u64 {
        self.lost_transport
    }

    /// Adds the counts of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.received += other.received;
        self.processed += other.processed;
        self.dropped_overload += other.dropped_overload;
        self.malformed += other.malformed;
        self.duplicate += other.duplicate;
        self.out_of_order += other.out_of_order;
        self.lost_transport += other.lost_transport;
        self.points += other.points;
        self.slices += other.slices;
        self.recorder_dropped += other.recorder_dropped;
        self.unpublished += other.unpublished;
        self.recorder_bytes += other.recorder_bytes;
        self.unpaired += other.unpaired;
        self.located += other.located;
        self.unlocated += other.unlocated;
        self.doubtful += other.doubtful;
        self.standing += other.standing;
        self.positions_refused += other.positions_refused;
        self.flooded += other.flooded;
        self.outside_calibration += other.outside_calibration;
        self.saturated += other.saturated;
        self.begun_again += other.begun_again;
        self.not_of_now += other.not_of_now;
        self.chosen.add(&other.chosen);
        self.no_stripe.add(&other.no_stripe);
        self.texture_px.add(&other.texture_px);
        self.noise_px.add(&other.noise_px);
    }

    /// True if every frame was measured and no result was dropped.
    pub(crate) const fn is_complete(&self) -> bool {
        self.rejected() == 0
            && self.dropped_overload == 0
            && self.lost() == 0
            && self.recorder_dropped == 0
            && self.unpublished == 0
            && self.unlocated == 0
    }
}

/// Durations of the stages of a frame on this machine: for the summary only, never in a message of a replay.
#[derive(Clone, Debug, Default)]
pub(crate) struct StageTimes {
    /// From the message to one channel of pixels.
    pub(crate) decode: Histogram,
    /// From the channel to the centreline.
    pub(crate) extract: Histogram,
    /// From the centreline to the profile in the scan.
    pub(crate) triangulate: Histogram,
    /// From the profile to the encoded results.
    pub(crate) encode: Histogram,
}

impl StageTimes {
    /// Adds the counts of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.decode.add(&other.decode);
        self.extract.add(&other.extract);
        self.triangulate.add(&other.triangulate);
        self.encode.add(&other.encode);
    }

    /// Returns the name and durations of each stage, in order.
    pub(crate) fn named(&self) -> [(&'static str, &Histogram); 4] {
        [
            ("decode", &self.decode),
            ("extract", &self.extract),
            ("triangulate", &self.triangulate),
            ("encode", &self.encode),
        ]
    }
}

/// Counters and durations of a whole run.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Counters of all frames.
    pub counts: Counts,
    /// Time per stage.
    pub(crate) stages: StageTimes,
    /// Wall-clock time.
    pub(crate) elapsed: Duration,
    /// Damaged places in the input; reading continued behind them.
    pub(crate) num_damaged: u64,
    /// True if a signal ended the run before the input did.
    pub(crate) was_interrupted: bool,
    /// Recordings of a live node that failed.
    pub(crate) recordings_failed: Failures,
}

impl Summary {
    /// Adds a subsequent run.
    pub(crate) fn add(&mut self, other: &Self) {
        self.counts.add(&other.counts);
        self.stages.add(&other.stages);
        self.elapsed += other.elapsed;
        self.num_damaged += other.num_damaged;
        self.was_interrupted |= other.was_interrupted;
        self.recordings_failed.add(&other.recordings_failed);
    }

    /// True if all input was read and measured.
    pub(crate) const fn is_complete(&self) -> bool {
        self.counts.is_complete()
            && self.num_damaged == 0
            && !self.was_interrupted
            && self.recordings_failed.num == 0
    }
}
