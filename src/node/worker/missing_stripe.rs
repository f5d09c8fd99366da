//! Frames without a stripe: counted, and the likely reason worked out from a few of them.

use crate::{
    msg::diagnostic_msgs::DiagnosticStatus,
    node::{
        statistics::Counts,
        status::{Interval, Note},
    },
    scanner::{
        diagnosis::{Diagnosis, Reason},
        image::Image,
        pipeline::Pipeline,
    },
};

/// A line in a smaller share of the cross-sections may be a chance find.
const SPARSE: f64 = 0.25;

/// A frame without a stripe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoStripe {
    /// The likely reason, if this frame was examined.
    pub(super) diagnosis: Option<Diagnosis>,
}

/// Finds frames without a stripe. Examines the first, the second, the fourth and so on of the frames with none, and
/// likewise of those with hardly any: in the long run that costs nothing, and a replay examines the same ones.
#[derive(Debug, Default)]
pub(super) struct Explainer {
    /// Frames without a point of a line.
    empty: Examined,
    /// Frames with a short line, which may be all there is, unless the line runs in the other direction.
    sparse: Examined,
}

/// Frames of a kind.
#[derive(Debug, Default)]
struct Examined {
    frames: u64,
    /// The reason of the last examination.
    last: Option<Reason>,
}

impl Examined {
    /// Counts a frame, and examines it if that is due.
    fn count(&mut self, explain: impl FnOnce() -> Diagnosis) -> Option<Diagnosis> {
        self.frames += 1;
        let diagnosis = self.frames.is_power_of_two().then(explain);
        self.last = diagnosis.map(|found| found.reason).or(self.last);
        diagnosis
    }
}

impl Explainer {
    /// Notes a measured frame; `Some` if it has no stripe.
    pub(super) fn note_frame(
        &mut self,
        stripe_share: f64,
        pipeline: &Pipeline,
        image: &Image<'_>,
    ) -> Option<NoStripe> {
        if stripe_share >= SPARSE {
            return None;
        }
        let is_empty = stripe_share <= 0.0;
        let kind = if is_empty { &mut self.empty } else { &mut self.sparse };
        let diagnosis = kind.count(|| pipeline.explain(image));
        let is_turned = kind.last == Some(Reason::Direction);
        (is_empty || is_turned).then_some(NoStripe { diagnosis })
    }
}

/// Returns a note for the diagnostics of an interval in which most frames had no stripe.
pub(super) fn note(interval: Interval, counts: &Counts) -> Option<Note> {
    interval.lacks_stripe.then(|| {
        let reason = counts.no_stripe.likely().map(|(diagnosis, _)| format!(": {diagnosis}"));
        Note {
            level: DiagnosticStatus::WARN,
            key: "stripe",
            text: format!("most frames have no stripe{}", reason.unwrap_or_default()),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{image::PixelFormat, params::Params};

    /// Shares of the frames, and whether each was examined; `None`: it counts as one with a stripe.
    fn examined(samples: &[u8], shares: &[f64]) -> Vec<Option<bool>> {
        let image = Image::packed(64, 96, PixelFormat::Mono8, samples).unwrap();
        let pipeline = Pipeline::new(Params::default(), None);
        let mut explainer = Explainer::default();
        let mut note = |share: &f64| explainer.note_frame(*share, &pipeline, &image);
        shares.iter().map(|share| note(share).map(|found| found.diagnosis.is_some())).collect()
    }

    #[test]
    fn short_lines_leave_the_examinations_to_empty_frames() {
        let dark = [0; 64 * 96];
        let found = examined(&dark, &[0.1, 0.1, 0.1, 0.1, 0.1, 0.0, 0.1, 0.0, 0.5, 0.0, 0.0]);
        let empty: Vec<_> = found.into_iter().flatten().collect();
        assert_eq!(empty, [true, true, false, true], "the first, second and fourth");
    }

    #[test]
    fn short_lines_across_the_searched_direction_are_no_stripe() {
        let vertical: Vec<u8> =
            (0..64 * 96).map(|at| if (30..38).contains(&(at % 64)) { 200 } else { 5 }).collect();
        assert_eq!(
            examined(&vertical, &[0.1, 0.1, 0.1, 0.0]),
            [Some(true), Some(true), Some(false), Some(true)]
        );
    }
}
