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

/// Finds frames without a stripe. Examines the first, the second, the fourth and so on of the frames with none or hardly
/// any: in the long run that costs nothing, and a replay examines the same ones.
#[derive(Debug, Default)]
pub(super) struct Explainer {
    sparse: u64,
    last: Option<Diagnosis>,
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
        self.sparse += 1;
        let is_due = self.sparse.is_power_of_two();
        if is_due {
            self.last = Some(pipeline.explain(image));
        }
        // Short lines may be all there is, unless the line runs in the other direction.
        let is_turned = self.last.is_some_and(|found| found.reason == Reason::Direction);
        (stripe_share <= 0.0 || is_turned)
            .then_some(NoStripe { diagnosis: self.last.filter(|_| is_due) })
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
