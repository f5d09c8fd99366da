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
    /// Finds the edges at these shares of every lane's peak, 0 to 1, descending, in one walk.
    #[inline(always)]
    pub(super) fn at<const N: usize>(
        sections: &Sections,
        brightest: &Lane,
        shares: [f32; N],
    ) -> [Self; N] {
        let edges = shares.map(|share| each(|lane| sections.peak[lane] * share));
        let top = each(|lane| sections.first[lane] + brightest[lane]);
        let (mut rise, mut fall) = ([Crossing::NONE; N], [Crossing::NONE; N]);
        // From the peak outwards, until every lane has the lowest edges, and with them the others.
        let tops = sections.reach(&top, &top);
        for i in (1..tops.end).rev() {
            let place = sections.place(i);
            let (level, neighbour) = (&sections.blurred[i], &sections.blurred[i - 1]);
            let mut outer = *neighbour;
            for lane in 0..LANES {
                let is_inside =
                    (i as f32 > sections.start[lane]) & (place[lane] <= brightest[lane]);
                outer[lane] = if is_inside { outer[lane] } else { f32::INFINITY };
            }
            for (rise, edge) in rise.iter_mut().zip(&edges) {
                rise.meet(edge, &place, level, &outer);
            }
            if rise.last().is_none_or(Crossing::is_complete) {
                break;
            }
        }
        for i in tops.start + 1..sections.rows() {
            let place = sections.place(i - 1);
            let (level, neighbour) = (&sections.blurred[i - 1], &sections.blurred[i]);
            let mut outer = *neighbour;
            for lane in 0..LANES {
                let is_inside =
                    (place[lane] >= brightest[lane]) & ((i as f32) < sections.end[lane]);
                outer[lane] = if is_inside { outer[lane] } else { f32::INFINITY };
            }
            for (fall, edge) in fall.iter_mut().zip(&edges) {
                fall.meet(edge, &place, level, &outer);
            }
            if fall.last().is_none_or(Crossing::is_complete) {
                break;
            }
        }
        std::array::from_fn(|n| Self {
            inner: [rise[n].place, fall[n].place],
            beyond: [rise[n].beyond(&edges[n]), fall[n].beyond(&edges[n])],
        })
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

/// The first pair of samples of every lane, from the peak outwards, between which the level falls below an edge.
#[derive(Clone, Copy)]
struct Crossing {
    /// Position of the inner sample; NaN: none yet.
    place: Lane,
    /// Levels of the inner and of the outer sample.
    inner: Lane,
    outer: Lane,
}

impl Crossing {
    const NONE: Self =
        Self { place: [f32::NAN; LANES], inner: [f32::NAN; LANES], outer: [f32::NAN; LANES] };

    /// Takes the next sample and its outer neighbour in lanes without crossing.
    #[inline(always)]
    fn meet(&mut self, edge: &Lane, place: &Lane, inner: &Lane, outer: &Lane) {
        for lane in 0..LANES {
            let is_first = (outer[lane] < edge[lane]) & self.place[lane].is_nan();
            self.place[lane] = if is_first { place[lane] } else { self.place[lane] };
            self.inner[lane] = if is_first { inner[lane] } else { self.inner[lane] };
            self.outer[lane] = if is_first { outer[lane] } else { self.outer[lane] };
        }
    }

    /// True if every lane has its crossing.
    #[inline(always)]
    fn is_complete(&self) -> bool {
        let mut is_open = false;
        for place in &self.place {
            is_open |= place.is_nan();
        }
        !is_open
    }

    /// Returns the distance of the crossing from the inner sample, 0 to 1.
    #[inline(always)]
    fn beyond(&self, edge: &Lane) -> Lane {
        each(|lane| (self.inner[lane] - edge[lane]) / (self.inner[lane] - self.outer[lane]))
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
    let rows = sections.candidate_rows();
    for i in rows.start.saturating_sub(1)..(rows.end + 1).min(sections.rows()) {
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
    let end = each(|lane| sections.end[lane] - 1.0);
    let left = each(|lane| {
        let row = sections.first[lane] + position_px[lane].floor();
        let row = if lane < sections.count { row } else { sections.start[lane] };
        row.max(sections.start[lane]).min(end[lane])
    });
    let right = each(|lane| (left[lane] + 1.0).min(end[lane]));
    let (mut before, mut behind) = ([0.0; LANES], [0.0; LANES]);
    for i in sections.reach(&left, &right) {
        let (row, level) = (i as f32, &sections.raw[i]);
        for lane in 0..LANES {
            before[lane] = if row <= left[lane] { level[lane] } else { before[lane] };
            behind[lane] = if row <= right[lane] { level[lane] } else { behind[lane] };
        }
    }
    each(|lane| {
        let share = (position_px[lane] - position_px[lane].floor()).max(0.0);
        let level = before[lane] * (1.0 - share) + behind[lane] * share;
        if lane < sections.count { level } else { 0.0 }
    })
}
