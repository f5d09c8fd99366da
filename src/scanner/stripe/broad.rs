//! Candidates that are too long for the cross-section of a stripe: a lamp, a white wall, a threshold below the background.

use super::section::Section;

/// What is told of such a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Broad {
    /// Grey-level centre of gravity, pixels from the candidate's first sample.
    pub position_px: f64,
    /// Unblurred level there, sample units.
    pub intensity: f32,
    /// Largest unblurred sample, sample units.
    pub brightest_raw: u32,
}

impl Broad {
    /// That of a section which holds the whole candidate.
    pub fn of(section: &Section<'_>) -> Self {
        let from = (section.candidate.first - section.origin) as usize;
        let run = from..from + section.candidate.length() as usize;
        let (mut level, mut moment) = (0_u64, 0_u64);
        for (place, &sample) in (0_u64..).zip(&section.samples[run.clone()]) {
            level += u64::from(sample);
            moment += place * u64::from(sample);
        }
        let raw = &section.raw[run];
        let position_px = moment as f64 / level as f64;
        let left = position_px as usize;
        let [at, next] = [left, (left + 1).min(raw.len() - 1)].map(|i| f64::from(raw[i]));
        Self {
            position_px,
            intensity: (at + (next - at) * (position_px - left as f64)) as f32,
            brightest_raw: raw.iter().copied().max().unwrap_or(0),
        }
    }
}
