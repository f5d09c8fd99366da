//! Tracking: stores the last frame's stripes and accepts candidates near them.

/// Positions of one stripe along its lines, half pixels.
#[derive(Clone, Debug, Default)]
struct Track {
    points: Vec<(u32, u32)>,
}

/// The stripes of the last frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Tracker {
    tracks: Vec<Track>,
    /// Number of tracks in use; the others are kept for their memory.
    count: usize,
    /// Points in all tracks.
    num_points: usize,
}

impl Tracker {
    /// Discards the last frame's stripes.
    pub(super) const fn clear(&mut self) {
        self.count = 0;
        self.num_points = 0;
    }

    /// Returns the number of points of the last frame's stripes.
    pub(super) const fn num_points(&self) -> usize {
        self.num_points
    }

    /// Starts the next stripe.
    pub(super) fn start_stripe(&mut self) {
        if self.count == self.tracks.len() {
            self.tracks.push(Track::default());
        }
        self.tracks[self.count].points.clear();
        self.count += 1;
    }

    /// Adds a point to the stripe started last: a line after the previous point's, and a position in half pixels.
    pub(super) fn push(&mut self, line: u32, middle: u32) {
        if let Some(track) = self.tracks[..self.count].last_mut() {
            track.points.push((line, middle));
            self.num_points += 1;
        }
    }

    /// True if a position is within `margin` half pixels of any of the stripes. A stripe is interpolated linearly in a
    /// gap and held constant beyond its ends.
    pub(super) fn is_near(&self, line: u32, middle: u32, margin: u32) -> bool {
        self.tracks[..self.count].iter().any(|track| {
            track
                .at(line)
                .is_some_and(|expected| (expected - f64::from(middle)).abs() <= f64::from(margin))
        })
    }
}

impl Track {
    fn at(&self, line: u32) -> Option<f64> {
        let behind = self.points.partition_point(|point| point.0 < line);
        let before = behind.checked_sub(1).map(|at| self.points[at]);
        match (before, self.points.get(behind).copied()) {
            (Some((l0, m0)), Some((l1, m1))) => {
                let share = f64::from(line - l0) / f64::from(l1 - l0);
                Some(f64::from(m0) + share * (f64::from(m1) - f64::from(m0)))
            }
            (Some((_, middle)), None) | (None, Some((_, middle))) => Some(f64::from(middle)),
            (None, None) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_bridged_and_ends_go_on() {
        let mut tracker = Tracker::default();
        assert!(!tracker.is_near(0, 0, 1000), "no stripe");
        tracker.start_stripe();
        tracker.push(10, 100);
        tracker.push(20, 200);
        for (line, middle, is_near) in
            [(15, 155, true), (15, 156, false), (0, 100, true), (0, 94, false), (99, 205, true)]
        {
            assert_eq!(tracker.is_near(line, middle, 5), is_near, "{line} {middle}");
        }
        tracker.start_stripe();
        tracker.push(15, 400);
        assert!(tracker.is_near(15, 399, 5) && tracker.num_points() == 3);
        tracker.clear();
        assert!(!tracker.is_near(15, 400, 5));
    }
}
