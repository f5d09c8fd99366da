//! Counters of the stream over a recording.

use crate::{
    msg::laser_profiler_msgs::StreamStatus,
    report::{
        chart::{Chart, Curve},
        page::Table,
        series::{Merge, Series},
    },
};

const MERGES: [Merge; 6] =
    [Merge::Mean, Merge::Mean, Merge::Mean, Merge::Max, Merge::Max, Merge::Max];

/// Final counters, and figures per second.
pub(crate) struct Status {
    /// Seconds since the first message, rate, latencies (median, 99 %, maximum), queue length.
    series: Series<6>,
    first_ns: Option<i64>,
    /// Names and values of the last counters.
    counters: Vec<(&'static str, u64)>,
}

impl Default for Status {
    fn default() -> Self {
        Self { series: Series::new(MERGES), first_ns: None, counters: Vec::new() }
    }
}

impl Status {
    /// Adds the next message.
    pub(crate) fn add(&mut self, status: &StreamStatus<'_>) {
        let stamp_ns = status.header.stamp.to_ns();
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        let ms = |seconds: f32| 1e3 * f64::from(seconds);
        self.series.push([
            stamp_ns.saturating_sub(first_ns) as f64 / 1e9,
            f64::from(status.rate),
            ms(status.latency_p50),
            ms(status.latency_p99),
            ms(status.latency_max),
            f64::from(status.queue_depth),
        ]);
        self.counters = vec![
            ("received", status.frames_received),
            ("measured", status.frames_processed),
            ("published", status.frames_published),
            ("lost before the middleware", status.lost_upstream),
            ("lost by the middleware", status.lost_transport),
            ("dropped by overload", status.dropped_overload),
            ("rejected: malformed", status.rejected_malformed),
            ("rejected: duplicate", status.rejected_duplicate),
            ("rejected: out of order", status.rejected_out_of_order),
            ("not recorded", status.recorder_dropped),
        ];
    }

    /// Returns the table of the last counters; `None` without a message.
    pub(crate) fn table(&self) -> Option<Table> {
        let row = |(name, value): &(&str, u64)| vec![(*name).to_owned(), value.to_string()];
        (!self.counters.is_empty()).then(|| Table {
            title: "Frames and drops".to_owned(),
            heads: ["Frames", "Number"].map(str::to_owned).into(),
            rows: self.counters.iter().map(row).collect(),
        })
    }

    /// Number of lost, dropped and rejected frames.
    pub(crate) fn num_lost(&self) -> Option<u64> {
        let counters = self.counters.get(3..)?;
        (!counters.is_empty()).then(|| counters.iter().map(|(_, value)| value).sum())
    }

    /// Returns the charts of rate, latency and queue over time.
    pub(crate) fn charts(&self) -> Vec<Chart> {
        let x = self.series.figure(0);
        let chart = |id, title, y_label, curves: &[(&str, usize)]| Chart {
            id,
            title,
            x_label: "time [s]",
            y_label,
            x: x.clone(),
            curves: curves
                .iter()
                .map(|(name, at)| Curve::new(name, self.series.figure(*at)))
                .collect(),
        };
        if x.is_empty() {
            return Vec::new();
        }
        vec![
            chart("rate", "Frames received", "rate [1/s]", &[("rate", 1)]),
            chart(
                "latency",
                "From the image's stamp to the published result",
                "latency [ms]",
                &[("median", 2), ("99 %", 3), ("maximum", 4)],
            ),
            chart("queue", "Frames in the queue", "frames", &[("queue", 5)]),
        ]
    }
}
