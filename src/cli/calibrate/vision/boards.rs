//! Finds boards in all pictures.

use anyhow::bail;
use serde_json::{Value as Json, json};

use super::{
    pictures::{self, Pictures, View},
    rejected::{self, Rejected},
};
use crate::{
    calibrate::{Board, BoardBend, BoardRejected, Target, TargetDetector},
    cli::{Outcome, settings},
    scanner::image::Image,
};

/// The content of one picture.
pub(super) struct Seen<T> {
    /// Columns and rows of the picture.
    pub(super) size_px: [u32; 2],
    /// The board, and the caller's own result for the picture.
    pub(super) found: Result<(Board, T), BoardRejected>,
}

/// Boards that were found, all in pictures of one size.
pub(crate) struct Boards<T> {
    /// Columns and rows of the pictures.
    pub(super) size_px: [u32; 2],
    /// Name of each board's picture.
    pub(super) names: Vec<String>,
    /// The boards.
    pub(super) found: Vec<Board>,
    /// The caller's own result for each picture.
    pub(super) beside: Vec<T>,
    /// Pictures without a board, or whose board was not used.
    pub(super) rejected: Vec<Rejected>,
    /// True if pictures could not be read.
    is_lossy: bool,
}

/// Reads a target.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid target.
pub(super) fn target(text: &str) -> anyhow::Result<Target> {
    text.parse().map_err(settings::usage)
}

/// Finds the board in every picture; `beside` computes the caller's own result for each picture with a board.
///
/// # Errors
/// No picture shows the board, or the pictures show a different board.
pub(super) fn find<T: Send>(
    pictures: &Pictures,
    target: &Target,
    min_corners: usize,
    beside: impl Fn(&Image<'_>) -> Result<T, String> + Sync,
) -> anyhow::Result<Boards<T>> {
    let detector = TargetDetector::new(target, min_corners)?;
    let seen = pictures.map(|image| {
        let found = match detector.detect(&pictures::gray(image, &pictures.params.scanner)) {
            Ok(board) => Ok((board, beside(image)?)),
            Err(rejected) => Err(rejected),
        };
        Ok(Seen { size_px: [image.width(), image.height()], found })
    });
    sort(seen, target)
}

fn sort<T>(views: Vec<View<Seen<T>>>, target: &Target) -> anyhow::Result<Boards<T>> {
    let sizes = || views.iter().filter_map(|view| Some(view.result.as_ref().ok()?.size_px));
    // The size of most pictures; the first such size if several are equally frequent.
    let count = |size: [u32; 2]| sizes().filter(|other| *other == size).count();
    let size_px = sizes().rev().max_by_key(|&size| count(size));
    let Some(size_px) = size_px else {
        let unread: Vec<_> = views.into_iter().filter_map(unread).collect();
        bail!("no picture can be read\n{}", rejected::text(&unread));
    };
    let mut boards = Boards {
        size_px,
        names: Vec::new(),
        found: Vec::new(),
        beside: Vec::new(),
        rejected: Vec::new(),
        is_lossy: false,
    };
    let mut num_larger = 0;
    for View { name, result, .. } in views {
        let reason = match result {
            Err(reason) => {
                boards.is_lossy = true;
                reason
            }
            Ok(seen) if seen.size_px != size_px => format!(
                "{} x {} pixels, most pictures have {} x {}",
                seen.size_px[0], seen.size_px[1], size_px[0], size_px[1]
            ),
            Ok(Seen { found: Ok((board, beside)), .. }) => {
                boards.names.push(name);
                boards.found.push(board);
                boards.beside.push(beside);
                continue;
            }
            Ok(Seen { found: Err(error), .. }) => {
                num_larger += usize::from(matches!(error, BoardRejected::Larger { .. }));
                error.to_string()
            }
        };
        boards.rejected.push(Rejected::new(name, reason));
    }
    boards.refuse_another(target, num_larger)?;
    Ok(boards)
}

/// Says what a bent board means for the result.
pub(super) fn describe(bend: BoardBend, result: &str) -> String {
    let meaning = if bend.is_shared {
        format!("the {result} accounts for it")
    } else {
        format!("the {result} is that of a flat board")
    };
    format!("{bend}: {meaning}")
}

/// Returns a board's bend as JSON.
pub(super) fn bend(bend: BoardBend) -> Json {
    json!({"bow_m": bend.bow_m, "sigma_m": bend.sigma_m, "is_shared": bend.is_shared})
}

fn unread<T>(view: View<T>) -> Option<Rejected> {
    let reason = view.result.err()?;
    Some(Rejected::new(view.name, reason))
}

impl<T> Boards<T> {
    /// Rejects a board of another size, which would be mistaken for a part of this one, or this one for a part of it.
    fn refuse_another(&self, target: &Target, num_larger: usize) -> anyhow::Result<()> {
        if num_larger > self.found.len() {
            bail!("--target is {target}, but the pictures show a larger board\n{}", self.summary());
        }
        if self.found.is_empty() {
            bail!("no picture shows the board {target}\n{}", self.summary());
        }
        if self.found.iter().all(|board| !target.is_identified(board)) {
            let largest = self.found.iter().max_by_key(|board| board.corners.len());
            let part = match (target, largest) {
                (Target::Circles(_), Some(board)) => {
                    format!("{} of {} circles", board.corners.len(), target.num_points())
                }
                (_, Some(board)) => format!(
                    "{} x {} corners (it counts inner corners, one less than squares)",
                    board.columns, board.rows
                ),
                (_, None) => "nothing".to_owned(),
            };
            bail!(
                "no picture shows the whole board {target}: the largest part has {part}. Is the target right?\n{}",
                self.summary()
            );
        }
        Ok(())
    }

    /// Rejects a board after it was found.
    pub(super) fn reject(&mut self, index: usize, reason: impl Into<String>) {
        self.rejected.push(Rejected::new(self.names[index].clone(), reason));
    }

    /// Lists the number of views and the reasons for rejections.
    pub(super) fn summary(&self) -> String {
        let (used, rejected) = (self.found.len(), self.rejected.len());
        format!(
            "{} with the board, {rejected} not used\n{}",
            rejected::views(used),
            rejected::text(&self.rejected)
        )
    }

    /// Returns a line about single corners that were left out; empty if there are none.
    pub(super) fn left_out(&self) -> String {
        let counts = || self.found.iter().map(|board| board.left_out).filter(|count| *count > 0);
        match counts().sum::<usize>() {
            0 => String::new(),
            corners => format!(
                "{corners} {} in {} left out: not where perspective and a lens put them, as under the laser's line\n",
                if corners == 1 { "corner" } else { "corners" },
                rejected::views(counts().count())
            ),
        }
    }

    /// Reports lost data if pictures could not be read.
    pub(super) const fn outcome(&self) -> Outcome {
        if self.is_lossy { Outcome::DataLost } else { Outcome::Done }
    }
}
