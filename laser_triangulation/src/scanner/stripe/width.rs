//! Further measurements of a point: width, brightness, saturation.

use super::lanes::{LANES, Lane, Sections, each};

/// Returns the position of the (first) brightest blurred sample of every lane's candidate, pixels from the candidate's
/// first.
#[inline(always)]
pub(super) fn brightest(sections: &Sections) -> Lane {
    let mut brightest = [0.0; LANES];
    let last = sections.last_place();
    for i in sections.candidate_rows().rev() {
        let (place, level) = (sections.place(i), sections.blurred[i]);
        for lane in 0..LANES {
            let is_peak = (place[lane] >= 0.0)
                & (place[lane] <= last[lane])
                & (level[lane] >= sections.peak[lane]);
            brightest[lane] = if is_peak { place[lane] } else { brightest[lane] };
        }
    }
    brightest
}

/// Positions about the peak at which the linearly interpolated blurred samples fall below a level, pixels from the
/// candidate's first sample. NaN where the border, a neighbour or a bright background hides the edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    /// Last samples at or above the level before and behind the peak.
    inner: [Lane; 2],
    /// Distances of the crossings from those samples, 0 to 1.
    beyond: [Lane; 2],
}

impl Edges {
    /// Finds the edges at that share of every lane's peak, 0 to 1.
    #[inline(always)]
    pub(super) fn at(sections: &Sections, brightest: &Lane, share: f32) -> Self {
        // Position of each edge's inner sample, its level and that of its outer neighbour.
        let mut rise = [[f32::NAN; LANES]; 3];
        let mut fall = [[f32::NAN; LANES]; 3];
        let edge = each(|lane| sections.peak[lane] * share);
        let top = each(|lane| sections.first[lane] + brightest[lane]);
        // From the peak outwards, until every lane has both edges.
        let rows = sections.reach(&sections.start, &top);
        for i in (rows.start + 1..rows.end).rev() {
            let (place, before, level) =
                (sections.place(i), &sections.blurred[i - 1], &sections.blurred[i]);
            let mut is_open = false;
            for lane in 0..LANES {
                let is_inside =
                    (i as f32 > sections.start[lane]) & (place[lane] <= brightest[lane]);
                let is_rise = is_inside & (before[lane] < edge[lane]) & rise[0][lane].is_nan();
                rise[0][lane] = if is_rise { place[lane] } else { rise[0][lane] };
                rise[1][lane] = if is_rise { level[lane] } else { rise[1][lane] };
                rise[2][lane] = if is_rise { before[lane] } else { rise[2][lane] };
                is_open |= rise[0][lane].is_nan();
            }
            if !is_open {
                break;
            }
        }
        let rows = sections.reach(&top, &each(|lane| sections.end[lane] - 1.0));
        for i in rows.start + 1..rows.end {
            let (place, before, level) =
                (sections.place(i), &sections.blurred[i - 1], &sections.blurred[i]);
            let mut is_open = false;
            for lane in 0..LANES {
                let is_inside = (place[lane] > brightest[lane]) & ((i as f32) < sections.end[lane]);
                let is_fall = is_inside & (level[lane] < edge[lane]) & fall[0][lane].is_nan();
                fall[0][lane] = if is_fall { place[lane] - 1.0 } else { fall[0][lane] };
                fall[1][lane] = if is_fall { before[lane] } else { fall[1][lane] };
                fall[2][lane] = if is_fall { level[lane] } else { fall[2][lane] };
                is_open |= fall[0][lane].is_nan();
            }
            if !is_open {
                break;
            }
        }
        // A crossing lies between a sample at or above the level and its outer neighbour below.
        let beyond = |[_, inside, outside]: &[Lane; 3]| {
            each(|lane| (inside[lane] - edge[lane]) / (inside[lane] - outside[lane]))
        };
        Self { inner: [rise[0], fall[0]], beyond: [beyond(&rise), beyond(&fall)] }
    }

    /// Returns the distance between the edges, pixels.
    #[inline(always)]
    pub(super) fn width_px(&self) -> Lane {
        let ([rise, fall], [before, behind]) = (&self.inner, &self.beyond);
        each(|lane| (fall[lane] - rise[lane]) + before[lane] + behind[lane])
    }

    /// Returns the position half way between the edges, pixels from the candidate's first sample.
    #[inline(always)]
    pub(super) fn middle_px(&self) -> Lane {
        let ([rise, fall], [before, behind]) = (&self.inner, &self.beyond);
        each(|lane| 0.5 * ((fall[lane] + rise[lane]) + (behind[lane] - before[lane])))
    }

    /// Returns the place of the first and of the last sample between the edges in a lane; `None` if an edge is hidden.
    pub(super) fn between(&self, lane: usize) -> Option<[f32; 2]> {
        let [first, last] = [self.inner[0][lane], self.inner[1][lane]];
        (first <= last).then_some([first, last])
    }
}

/// Returns the full width at half maximum, pixels, from the edges at half the peak, with the blur's own width removed in
/// quadrature. Stripes thinner than 2 pixels come out up to a tenth too wide. NaN where an edge is hidden.
#[inline(always)]
pub(super) fn full_width_half_maximum(half: &Edges, blur_variance_px2: f64) -> Lane {
    // 8 ln 2: from a Gaussian's variance to its squared full width at half maximum.
    let blur = (8.0 * std::f64::consts::LN_2 * blur_variance_px2) as f32;
    let width = half.width_px();
    each(|lane| {
        let squared = width[lane] * width[lane] - blur;
        // Not `max`, which would turn NaN into 0.
        (if squared < 0.0 { 0.0 } else { squared }).sqrt()
    })
}

/// Returns the largest unblurred sample of every lane's candidate and of one neighbour on either side.
#[inline(always)]
pub(super) fn brightest_raw(sections: &Sections) -> Lane {
    let mut brightest = [0.0; LANES];
    let from = each(|lane| (sections.first[lane] - 1.0).max(sections.start[lane]));
    let to = each(|lane| (sections.last[lane] + 1.0).min(sections.end[lane] - 1.0));
    for i in sections.reach(&from, &to) {
        let (row, level) = (i as f32, sections.raw[i]);
        for lane in 0..LANES {
            let is_near = (row >= from[lane]) & (row <= to[lane]) & (level[lane] > brightest[lane]);
            brightest[lane] = if is_near { level[lane] } else { brightest[lane] };
        }
    }
    brightest
}

/// Returns the unblurred level of every lane at a position between samples, linearly interpolated.
#[inline(always)]
pub(super) fn raw_at(sections: &Sections, position_px: &Lane) -> Lane {
    each(|lane| {
        if lane >= sections.count {
            return 0.0;
        }
        let (start, end) = (sections.start[lane], sections.end[lane] - 1.0);
        let left = (sections.first[lane] + position_px[lane].floor()).max(start).min(end);
        let right = (left + 1.0).min(end);
        let share = (position_px[lane] - position_px[lane].floor()).max(0.0);
        let [left, right] = [left, right].map(|row| sections.raw[row as usize][lane]);
        left * (1.0 - share) + right * share
    })
}
