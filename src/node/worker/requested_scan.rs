//! Scans on request: their start, their limits, and their progress for whoever waits for the end.

use std::time::{Duration, Instant};

use super::{Worker, measurer::Outcome, online::answer};
use crate::{
    node::{
        clock::system_ns,
        command::{Answer, Reply, ScanRequest},
        publisher::{PublishError, Publisher},
        scan_watch::{ScanEnd, ScanWatch},
        statistics::Counts,
        status,
    },
    scanner::axis::AxisTravel,
};

/// The requested scan. Whoever waits for it is told when it is dropped.
pub(super) struct RequestedScan {
    /// Length at which it ends, metres; `None`: unlimited, as the other limits.
    length_m: Option<f64>,
    frames: Option<u64>,
    duration: Option<Duration>,
    since: Instant,
    watch: Option<ScanWatch>,
    /// The counters at its first frame.
    base: Option<Counts>,
}

impl RequestedScan {
    fn new(request: &ScanRequest) -> Self {
        let ScanRequest { length_m, frames, duration, ref watch, .. } = *request;
        let (since, watch) = (Instant::now(), watch.clone());
        Self { length_m, frames, duration, since, watch, base: None }
    }

    /// Notes a frame of the scan.
    fn note(&mut self, outcome: &Outcome, counts: &Counts, travelled: Option<AxisTravel>) {
        self.base.get_or_insert(*counts);
        self.note_unused(counts);
        let Some(watch) = &self.watch else { return };
        watch.update(|progress| {
            progress.accepted += 1;
            progress.points += outcome.num_points;
            progress.position = outcome.position.map(|position| position.value.0);
            progress.travelled_m = match travelled {
                Some(AxisTravel::Metres(travelled_m)) => Some(travelled_m),
                Some(AxisTravel::Radians(_)) | None => None,
            };
        });
    }

    /// Notes the frames since the first one that are missing or were not used.
    fn note_unused(&self, counts: &Counts) {
        let (Some(watch), Some(base)) = (&self.watch, &self.base) else { return };
        let unused =
            |counts: &Counts| counts.rejected() + counts.dropped_overload + counts.unlocated;
        watch.update(|progress| {
            progress.missing = counts.lost() - base.lost();
            progress.rejected = unused(counts) - unused(base);
        });
    }

    /// Returns the limit that is reached.
    fn reached(&self, travelled: Option<AxisTravel>) -> Option<ScanEnd> {
        let has_begun = self.base.is_some();
        let reaches = |length_m| travelled.is_some_and(|travelled| travelled.reaches_m(length_m));
        let accepted = self.watch.as_ref().map_or(0, |watch| watch.wait(Duration::ZERO).accepted);
        if has_begun && self.length_m.is_some_and(reaches) {
            Some(ScanEnd::Length)
        } else if self.frames.is_some_and(|frames| accepted >= frames) {
            Some(ScanEnd::Frames)
        } else if self.duration.is_some_and(|duration| self.since.elapsed() >= duration) {
            Some(ScanEnd::Duration)
        } else if self.watch.as_ref().is_some_and(ScanWatch::has_ended) {
            // It was rejected because its start took too long.
            Some(ScanEnd::Stopped)
        } else {
            None
        }
    }

    /// Ends the scan for whoever waits for it.
    fn end(&self, why: ScanEnd, counts: &Counts) {
        self.note_unused(counts);
        if let Some(watch) = &self.watch {
            watch.end(why);
        }
    }
}

impl Drop for RequestedScan {
    fn drop(&mut self) {
        if let Some(watch) = &self.watch {
            watch.end(ScanEnd::NodeEnded);
        }
    }
}

impl Worker {
    pub(super) fn start_scan(
        &mut self,
        request: ScanRequest,
        reply: &Reply,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        if request.watch.as_ref().is_some_and(ScanWatch::has_ended) {
            // This worker was busy, and whoever asked has been told so.
            return Ok(());
        }
        if let Err(message) = self.check_scan(&request) {
            drop(reply.try_send(Answer { success: false, message, scan_id: None }));
            return Ok(());
        }
        self.end_requested_scan(ScanEnd::Replaced, out)?;
        let scan_id = self.next_scan_id();
        self.measurer.pipeline.start_scanning();
        self.measurer.pipeline.set_next_scan_id(scan_id);
        self.set_scan(request);
        answer(reply, "the scan begins with the next frame", scan_id);
        Ok(())
    }

    /// `Err`: the reason to refuse the request.
    fn check_scan(&self, request: &ScanRequest) -> Result<(), String> {
        if !self.measurer.pipeline.is_calibrated() {
            return Err("a scan needs a calibration: set calibration_file".to_owned());
        }
        match request.length_m {
            Some(length_m) if self.measurer.pipeline.travels_by_angle() => Err(format!(
                "length is {length_m} m, but the axis is revolute and turns by an angle: set length to 0 and end the scan \
                 with ~/stop_scan, or limit its frames with scan.max_profiles"
            )),
            _ => Ok(()),
        }
    }

    /// The identity is chosen before the first frame: the caller may wait for the answer before it starts the motion.
    fn next_scan_id(&mut self) -> Option<[u8; 16]> {
        let online = self.online.as_mut()?;
        online.num_requested += 1;
        let seed =
            format!("{:?} {} {}", self.reporter.session_id, online.num_requested, system_ns());
        Some(status::session_id(&self.reporter.topic, &seed))
    }

    pub(super) fn stop_scan(
        &mut self,
        why: ScanEnd,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.end_requested_scan(why, out)?;
        self.measurer.pipeline.stop_scanning();
        self.set_scan(ScanRequest::default());
        Ok(())
    }

    /// Ends the scan, then tells whoever waits for it: its last slice and its height map are published by then.
    fn end_requested_scan(
        &mut self,
        why: ScanEnd,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let scan = self.online.as_mut().and_then(|online| online.scan.take());
        self.end_scan(out)?;
        if let Some(scan) = scan {
            scan.end(why, self.ledger.counts());
        }
        Ok(())
    }

    /// Ends the requested scan for who waits for it. The measurement is not affected.
    pub(super) fn give_up_scan(&mut self, why: ScanEnd) {
        if let Some(scan) = self.online.as_mut().and_then(|online| online.scan.take()) {
            scan.end(why, self.ledger.counts());
        }
    }

    /// Called when a scan ends other than on request: it is over for who waits for it, and no other one begins.
    pub(super) fn note_interruption(&mut self) {
        let scan = self.online.as_ref().and_then(|online| online.scan.as_ref());
        if scan.is_some_and(|scan| scan.base.is_some()) {
            self.abort_watched_scan();
        }
    }

    /// Ends the scan that somebody waits for, even before its first frame. Further frames give profiles only.
    pub(super) fn abort_watched_scan(&mut self) {
        let scan = self.online.as_ref().and_then(|online| online.scan.as_ref());
        if scan.is_some_and(|scan| scan.watch.is_some()) {
            self.give_up_scan(ScanEnd::Interrupted);
            self.measurer.pipeline.stop_scanning();
        }
    }

    pub(super) fn set_scan(&mut self, request: ScanRequest) {
        if let Some(online) = &mut self.online {
            online.scan = Some(RequestedScan::new(&request));
        }
        self.measurer.results.set_part_id(request.part_id);
    }

    /// Notes a measured frame of the requested scan.
    pub(super) fn note_scanned(&mut self, outcome: &Outcome) {
        let is_placed = outcome.position.is_some() || !outcome.measures_positions;
        let is_open = self.measurer.pipeline.scan_id().is_some();
        if let Some(scan) = self.online.as_mut().and_then(|online| online.scan.as_mut())
            && is_placed
            && is_open
        {
            scan.note(outcome, self.ledger.counts(), self.measurer.travelled);
        }
    }

    /// Ends a scan that has reached a limit.
    pub(super) fn end_at_limit(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        let travelled = self.measurer.travelled;
        let scan = self.online.as_ref().and_then(|online| online.scan.as_ref());
        match scan.and_then(|scan| scan.reached(travelled)) {
            Some(ScanEnd::Stopped) => self.stop_scan(ScanEnd::Stopped, out),
            Some(why) => {
                let limit = match why {
                    ScanEnd::Length => "length",
                    ScanEnd::Frames => "number of frames",
                    _ => "duration",
                };
                tracing::info!("the scan ends at its {limit}");
                self.stop_scan(why, out)
            }
            None => Ok(()),
        }
    }
}
