//! The counters of a stream: every frame ends in exactly one bin, and the next good frame states the gap before it.

use std::cmp::Ordering;

use thiserror::Error;

use super::{
    chosen_channel::ChosenChannel, measurer::Outcome, missing_stripe::NoStripe, online::Stamped,
};
use crate::{
    msg::{cdr::CdrError, convert::FrameRejected},
    node::{
        camera_info::Conflict,
        order::{Place, Sequence, StampFault, StampOrder, StampStep},
        source::PublisherId,
        statistics::Counts,
    },
    scanner::{
        axis::RawPosition,
        coverage::LARGEST_SHARE,
        exposure_pair::ExposurePairing,
        frame_error::FrameError,
        frame_index::FrameIndex,
        motion::{Position, doubt},
    },
};

/// Maximum number of rejected pictures of a kind that are named in the log.
const MAX_NAMED: u64 = 10;

/// The reason to reject a frame.
#[derive(Debug, Error)]
pub(super) enum Rejection {
    #[error("malformed: {0}")]
    Message(#[from] CdrError),
    #[error("malformed: {0}")]
    Image(#[from] FrameRejected),
    #[error("malformed: {0}")]
    Params(#[from] FrameError),
    #[error("malformed: {0}")]
    CameraInfo(#[from] Conflict),
    #[error("malformed: {0}")]
    Transport(String),
    #[error("its stamp equals that of the previous frame")]
    Duplicate,
    #[error("its stamp is before that of an earlier frame")]
    OutOfOrder,
}

/// The gap before the next good frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gap {
    /// Frames that never arrived.
    pub(super) missing: u32,
    /// Frames rejected, or dropped by the full queue.
    pub(super) rejected: u32,
    /// True if more frames may be missing than `missing` states.
    is_unknown: bool,
}

/// Counters, order and gaps of one stream.
#[derive(Default)]
pub(super) struct Ledger {
    counts: Counts,
    pending: Gap,
    sequence: Sequence,
    stamps: StampOrder,
    last_publisher: PublisherId,
    last_rejection: Option<String>,
    channel: ChosenChannel,
}

impl Ledger {
    /// All counters so far.
    pub(super) const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Counts frames that a full queue dropped before the next one.
    pub(super) fn count_dropped(&mut self, num_dropped: u32) {
        self.counts.received += u64::from(num_dropped);
        self.counts.dropped_overload += u64::from(num_dropped);
        self.pending.rejected = self.pending.rejected.saturating_add(num_dropped);
        self.sequence.skip(num_dropped);
    }

    /// Counts a frame that arrived.
    pub(super) const fn count_received(&mut self) {
        self.counts.received += 1;
    }

    /// Counts a message that the middleware could not deliver.
    pub(super) fn count_fault(&mut self, what: &str, time_ns: i64) {
        self.counts.received += 1;
        // The message has a sequence number, but it is unknown.
        self.sequence.skip(1);
        self.reject(&Rejection::Transport(what.to_owned()), time_ns, None);
    }

    /// Notes the publisher of the next frame: each numbers its own messages.
    pub(super) fn note_publisher(&mut self, publisher: PublisherId) {
        if std::mem::replace(&mut self.last_publisher, publisher) != publisher {
            self.sequence.restart();
        }
    }

    /// Checks that a stamp continues the stream.
    ///
    /// # Errors
    /// The stamp repeats the last one or lies before it.
    pub(super) fn check_stamp(
        &mut self,
        stamp_ns: i64,
        sequence: u32,
    ) -> Result<StampStep, Rejection> {
        self.stamps.take(stamp_ns).map_err(|fault| {
            let missing = self.sequence.take_repeated(sequence);
            self.count_missing(missing);
            match fault {
                StampFault::Duplicate => Rejection::Duplicate,
                StampFault::OutOfOrder => Rejection::OutOfOrder,
            }
        })
    }

    /// The place of the next frame, with all frames missing since the last good one.
    pub(super) fn place(&mut self, sequence: u32) -> Place {
        let place = self.sequence.take(sequence);
        self.count_missing(place.missing.unwrap_or(0));
        self.pending.is_unknown |= place.missing.is_none();
        Place { missing: (!self.pending.is_unknown).then_some(self.pending.missing), ..place }
    }

    /// The index of the frame at `place`, with the gap before it.
    pub(super) const fn index(&self, place: Place) -> FrameIndex {
        FrameIndex {
            frame_number: place.frame_number,
            frames_missing: self.pending.missing,
            frames_rejected: self.pending.rejected,
        }
    }

    /// Closes the gap before the next frame and returns it.
    pub(super) fn take_gap(&mut self) -> Gap {
        std::mem::take(&mut self.pending)
    }

    /// Counts a measured frame.
    pub(super) fn count_processed(&mut self, outcome: &Outcome) {
        self.pending = Gap::default();
        self.counts.processed += 1;
        self.counts.points += outcome.num_points;
        self.counts.slices += u64::from(outcome.has_slice);
        self.counts.unpaired += u64::from(is_unpaired(outcome.pairing));
        if outcome.measures_positions {
            self.counts.located += u64::from(outcome.position.is_some());
            self.counts.unlocated += u64::from(outcome.position.is_none());
        }
        self.counts.saturated += outcome.num_saturated;
        self.channel.note_frame(outcome.channel_choice, &mut self.counts.chosen);
        self.count_no_stripe(outcome.no_stripe);
        self.counts.texture_px.extend(outcome.sigma_parts.map(|parts| parts.texture_px));
        self.counts.noise_px.extend(outcome.sigma_parts.map(|parts| parts.noise_px));
        self.count_flooded(outcome);
        self.count_outside(outcome.num_outside_calibration);
        self.count_doubtful(outcome.stamp_ns, outcome.position);
        self.counts.standing += u64::from(outcome.stands);
    }

    /// Counts slices that ended without a subsequent frame.
    pub(super) fn count_last_slices(&mut self, num_slices: usize) {
        self.counts.slices += num_slices as u64;
    }

    /// Counts a rejected frame in the bin of its reason. Warns about the first of each bin, and about the first ones that
    /// can be named: pictures, by their file.
    pub(super) fn reject(&mut self, rejection: &Rejection, time_ns: i64, file: Option<&str>) {
        let count = match rejection {
            Rejection::Duplicate => &mut self.counts.duplicate,
            Rejection::OutOfOrder => &mut self.counts.out_of_order,
            _ => &mut self.counts.malformed,
        };
        *count += 1;
        let has_name = file.is_some() || matches!(rejection, Rejection::Transport(_));
        let max_logged = if has_name { MAX_NAMED } else { 1 };
        let text = match file {
            Some(file) => format!("{file}: {rejection}"),
            None => rejection.to_string(),
        };
        // The summary counts the rest.
        match (*count).cmp(&max_logged) {
            Ordering::Less => tracing::warn!("frame rejected (log time {time_ns} ns): {text}"),
            Ordering::Equal => tracing::warn!(
                "frame rejected (log time {time_ns} ns): {text}; further ones of this kind are only counted"
            ),
            Ordering::Greater => {
                tracing::debug!("frame rejected (log time {time_ns} ns): {text}");
            }
        }
        self.pending.rejected = self.pending.rejected.saturating_add(1);
        self.last_rejection = Some(text);
    }

    /// Sets the number of messages about positions that could not be used.
    pub(super) const fn set_positions_refused(&mut self, num_refused: u64) {
        self.counts.positions_refused = num_refused;
    }

    /// Sets the number of results that the full queue of the middleware dropped.
    pub(super) const fn set_unpublished(&mut self, num_dropped: u64) {
        self.counts.unpublished = num_dropped;
    }

    /// Sets the bytes that the recorder received and the messages that it dropped.
    pub(super) const fn set_recorded(&mut self, num_bytes: u64, num_dropped: u64) {
        self.counts.recorder_bytes = num_bytes;
        self.counts.recorder_dropped = num_dropped;
    }

    /// The reason for the last rejection since the last call.
    pub(super) const fn take_last_rejection(&mut self) -> Option<String> {
        self.last_rejection.take()
    }

    /// The name of the channel that `channel: auto` stands for in the last frame; `None` if it stands for none.
    pub(super) fn channel(&self) -> Option<&'static str> {
        self.channel.name()
    }

    /// Prepares for stamps and sequence numbers that do not continue the earlier ones. Counters continue.
    pub(super) fn restart(&mut self) {
        self.stamps = StampOrder::default();
        self.sequence.restart();
        self.channel = ChosenChannel::default();
    }

    /// Counts a stream that begins again after [`restart`](Self::restart), with its first stamp. Logs the first one.
    pub(super) fn begin_again(&mut self, stamp_ns: i64) {
        self.counts.begun_again += 1;
        // After a restart, any stamp is right.
        _ = self.stamps.take(stamp_ns);
        if self.counts.begun_again == 1 {
            tracing::info!(
                "the stamps begin again at {stamp_ns} ns, as in a recording that is played in a loop: starting a new session; \
                 further ones are only counted"
            );
        }
    }

    /// Counts a frame by the relation of its stamp to the present.
    pub(super) const fn count_not_of_now(&mut self, stamped: Stamped) {
        if matches!(stamped, Stamped::NotOfNow) {
            self.counts.not_of_now += 1;
        }
    }

    fn count_missing(&mut self, missing: u32) {
        self.counts.lost_transport += u64::from(missing);
        self.pending.missing = self.pending.missing.saturating_add(missing);
    }

    /// Counts a frame without a stripe. Warns about the first of each reason.
    fn count_no_stripe(&mut self, no_stripe: Option<NoStripe>) {
        let Some(NoStripe { diagnosis }) = no_stripe else { return };
        if self.counts.no_stripe.count(diagnosis)
            && let Some(diagnosis) = diagnosis
        {
            tracing::warn!(
                "a frame has no stripe. Likely reason: {diagnosis}; further such frames are only counted"
            );
        }
    }

    /// Counts a frame with too many bright pixels for a stripe. Warns about the first.
    fn count_flooded(&mut self, outcome: &Outcome) {
        let share = outcome.share_above_threshold.filter(|share| *share > LARGEST_SHARE);
        let Some(share) = share else { return };
        self.counts.flooded += 1;
        if self.counts.flooded == 1 {
            // Of a saturated stripe, subtracting the background and the excess of a colour leave the halo.
            let is_saturated = 2 * outcome.num_saturated > outcome.num_points;
            let remedy = if is_saturated {
                "most points are saturated, so shorten the exposure, or raise the threshold"
            } else {
                "raise it, or set extraction.background: local and extraction.threshold: adaptive"
            };
            tracing::warn!(
                "{:.0} % of the searched pixels are above extraction.segment_threshold, too many for a stripe: {remedy}; further \
                 such frames are only counted",
                100.0 * share
            );
        }
    }

    /// Counts points outside the calibrated volume. Warns about the first.
    fn count_outside(&mut self, num_points: u64) {
        if num_points > 0 && self.counts.outside_calibration == 0 {
            tracing::warn!(
                "{num_points} points of this profile lie outside the volume from which the calibration has data (`volume` in \
                 its file): their heights are extrapolated. They carry FLAG_OUTSIDE_CALIBRATION; calibrate over the whole \
                 range of the parts, or set roi.*; further such points are only counted"
            );
        }
        self.counts.outside_calibration += num_points;
    }

    /// Counts a frame with a doubtful position. Warns about the first.
    fn count_doubtful(&mut self, stamp_ns: i64, position: Option<Position>) {
        let Some(Position { doubts, value: RawPosition(value), .. }) =
            position.filter(|position| position.doubts != 0)
        else {
            return;
        };
        self.counts.doubtful += 1;
        if self.counts.doubtful == 1 {
            tracing::warn!(
                "the position {value} of the frame at {stamp_ns} ns is in doubt: {}; its slice will be DEGRADED; further ones \
                 are only counted",
                in_words(doubts)
            );
        }
    }
}

/// True if a frame lacks its other exposure. Logs the reason if the scene or the parameters cause it.
fn is_unpaired(pairing: Option<ExposurePairing>) -> bool {
    if pairing == Some(ExposurePairing::Alike) {
        tracing::debug!("exposures alternate, but this frame is as bright as the previous one");
    }
    matches!(pairing, Some(ExposurePairing::Alone | ExposurePairing::Alike))
}

fn in_words(doubts: u8) -> String {
    let words = [
        (doubt::GAP, "the samples around it lie further apart than motion.max_step"),
        (doubt::REVERSED, "the axis moved against the scan direction"),
        (doubt::STALE, "the samples around it lie further apart in time than motion.max_gap"),
        (doubt::EXTRAPOLATED, "no later sample arrived in time"),
    ];
    let set = words.iter().filter(|(bit, _)| doubts & bit != 0).map(|(_, text)| *text);
    set.collect::<Vec<_>>().join(", ")
}
