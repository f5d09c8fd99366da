//! The point clouds of one scan, profile by profile.

use std::ops::Range;

use anyhow::ensure;
use nalgebra::Point3;

use super::{
    Provenance, ScanSelection, cloud, read_options,
    selection::{choose_scan, choose_topic},
};
use crate::{
    bag::{BagReader, Filter, RawMessage},
    metrology::surface::{Region, Surface},
    msg::{
        cdr,
        convert::results::stripe_direction,
        laser_profiler_msgs::{Centerline, SliceInfo},
        sensor_msgs::PointCloud2,
    },
    scanner::{params::StripeDirection, scan::Point},
};

/// Heights without limits, metres.
pub(crate) const ANY_HEIGHT_M: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
/// Maximum number of points of a surface in memory: 1.5 GiB.
const MAX_POINTS: usize = 1 << 26;

/// One scan of an open results bag.
pub(crate) struct Results {
    pub(super) bag: BagReader,
    topic: String,
    provenance: Provenance,
    /// Numbers of the scan's slices; slices without an account belong to the last scan.
    slices: Range<u64>,
    accounts: Vec<Account>,
}

/// The points of a region.
#[derive(Clone, Debug)]
pub(crate) struct Scanned {
    /// One row of points per profile; profiles without a point in the region are omitted.
    pub(crate) surface: Surface,
    /// Profile number of each row in the scan, from 0.
    pub(crate) profile_numbers: Vec<usize>,
    /// Profiles and clouds read.
    pub(crate) counts: ReadCounts,
}

/// Counts of reading a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ReadCounts {
    /// Profiles read.
    pub(crate) profiles: u64,
    /// Clouds that could not be read.
    pub(crate) rejected: u64,
}

impl Results {
    /// Opens a results bag and chooses topic and scan.
    ///
    /// # Errors
    /// No bag or no clouds; [`SelectionError`](super::SelectionError) if the topic or scan must be chosen.
    pub(crate) fn open(selection: &ScanSelection) -> anyhow::Result<Self> {
        let bag = BagReader::open(&selection.bag, &read_options())?;
        bag.notes().iter().for_each(|note| tracing::warn!("{note}"));
        let topic = choose_topic(&bag, selection)?;
        let accounts = accounts(&bag, &topic);
        let last = (0_u64..).zip(&accounts).filter(|(_, account)| account.is_last);
        let ends: Vec<u64> = last.map(|(number, _)| number).collect();
        let slices = choose_scan(&ends, selection.scan)?;
        let provenance = Provenance::read(&bag, |error| tracing::warn!("{error}"));
        Ok(Self { bag, topic, provenance, slices, accounts })
    }

    /// Topic of the point clouds.
    #[must_use]
    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }

    /// Version, parameters and calibration.
    #[must_use]
    pub(crate) const fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// Returns the topic of the profiles beside the clouds; `None` if there is none.
    #[must_use]
    pub(crate) fn profile_topic(&self) -> Option<String> {
        self.topic_beside("profile")
    }

    fn topic_beside(&self, name: &str) -> Option<String> {
        let name = format!("{}{name}", self.topic.strip_suffix("points")?);
        self.bag.topics().iter().any(|topic| topic.name == name).then_some(name)
    }

    /// Returns the direction of the stripe, from the first centreline beside the clouds.
    ///
    /// # Errors
    /// The reason why it is unknown: no centrelines, or centrelines of a version that did not state it.
    pub(crate) fn stripe_direction(&self) -> Result<StripeDirection, String> {
        let missing = "the recording has no centrelines, which state the direction of the stripe";
        let topic = self.topic_beside("centerline").ok_or(missing)?;
        let first = self.messages(&topic).flatten().next().ok_or(missing)?;
        let line: Centerline<'_> = cdr::decode(&first.data).map_err(|error| error.to_string())?;
        stripe_direction(&line).map_err(|error| error.to_string())
    }

    /// Returns the scan's messages on a topic of its bag, in time order.
    pub(crate) fn messages(&self, topic: &str) -> crate::bag::Messages {
        self.bag.messages(&Filter::topics([topic]))
    }

    /// True if the scan covers a frame, or if the bag has no account of its slices.
    #[must_use]
    pub(crate) fn has_frame(&self, number: u64) -> bool {
        let mut frames = self.accounts().map(|account| account.frames).peekable();
        frames.peek().is_none() || frames.any(|[first, last]| (first..=last).contains(&number))
    }

    /// Accounts of the scan's slices.
    pub(super) fn accounts(&self) -> impl Iterator<Item = &Account> {
        let accounts = (0_u64..).zip(&self.accounts);
        accounts.filter(|(at, _)| self.slices.contains(at)).map(|(_, account)| account)
    }

    /// Calls `take` with every profile of the scan in the order of its frames.
    ///
    /// Counts and skips a cloud that cannot be read.
    ///
    /// # Errors
    /// Those of `take`.
    pub(crate) fn for_each_profile(
        &self,
        mut take: impl FnMut(&[Point]) -> anyhow::Result<()>,
    ) -> anyhow::Result<ReadCounts> {
        let mut counts = ReadCounts::default();
        let mut row = Vec::new();
        for (number, message) in (0_u64..).zip(self.messages(&self.topic)) {
            if !self.slices.contains(&number) {
                continue;
            }
            let message = match message {
                Ok(message) => message,
                Err(error) => {
                    counts.reject(&error.into());
                    continue;
                }
            };
            let cloud = cdr::decode::<PointCloud2<'_>>(&message.data).map_err(anyhow::Error::from);
            match cloud.and_then(|cloud| cloud::Rows::new(&cloud)) {
                Ok(rows) => {
                    for at in 0..rows.len() {
                        rows.read(at, &mut row);
                        counts.profiles += 1;
                        take(&row)?;
                    }
                }
                Err(error) => counts.reject(&error),
            }
        }
        Ok(counts)
    }

    /// Returns the points of a region whose heights lie from `low_m` to `high_m`, as a surface.
    ///
    /// # Errors
    /// No such point, profiles of different lengths, or more than 2^26 points.
    pub(crate) fn surface(
        &self,
        region: &Region,
        [low_m, high_m]: [f64; 2],
    ) -> anyhow::Result<Scanned> {
        let mut surface = Surface::default();
        let (mut profile_numbers, mut number) = (Vec::new(), 0);
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let counts = self.for_each_profile(|profile| {
            let inside = |point: &Point| {
                let [x, y, z, _] = point.map(f64::from);
                z.is_finite() && (low_m..=high_m).contains(&z) && region.contains(x, y)
            };
            number += 1;
            if !profile.iter().any(inside) {
                return Ok(());
            }
            profile_numbers.push(number - 1);
            ensure!(
                surface.points.is_empty() || surface.width == profile.len(),
                "profiles of {} and of {} points in one scan",
                surface.width,
                profile.len()
            );
            ensure!(
                surface.points.len() + profile.len() <= MAX_POINTS,
                "more than {MAX_POINTS} points: choose a region"
            );
            surface.width = profile.len();
            surface.points.extend(profile.iter().map(|point| {
                let [x, y, z, _] = point.map(f64::from);
                if inside(point) { Point3::new(x, y, z) } else { nowhere }
            }));
            Ok(())
        })?;
        ensure!(
            !surface.points.is_empty(),
            "no point was measured{}",
            describe_limits(region, [low_m, high_m])
        );
        Ok(Scanned { surface, profile_numbers, counts })
    }
}

impl ReadCounts {
    fn reject(&mut self, error: &anyhow::Error) {
        self.rejected += 1;
        if self.rejected == 1 {
            tracing::warn!("point cloud skipped: {error:#}; further ones are only counted");
        }
    }
}

fn describe_limits(region: &Region, [low_m, high_m]: [f64; 2]) -> String {
    let ([x0, y0], [x1, y1]) = (region.from_m, region.to_m);
    let place = if *region == Region::ALL {
        String::new()
    } else {
        format!(" in the region x {x0} to {x1} m, y {y0} to {y1} m")
    };
    if [low_m, high_m] == ANY_HEIGHT_M {
        return place;
    }
    format!("{place} at heights from {low_m} to {high_m} m")
}

/// Account of a slice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Account {
    /// First and last frame.
    pub(super) frames: [u64; 2],
    pub(super) profiles: u32,
    /// Positions of its first and last profile, metres or radians.
    pub(super) positions: [f64; 2],
    /// True if its state is DEGRADED or worse.
    pub(super) is_degraded: bool,
    /// True if the scan ends with the slice.
    is_last: bool,
}

/// Returns the accounts of the slices in their order; an unreadable one covers frame 0 and ends no scan.
fn accounts(bag: &BagReader, topic: &str) -> Vec<Account> {
    let Some(prefix) = topic.strip_suffix("points") else { return Vec::new() };
    let infos = format!("{prefix}slice_info");
    let read = |message: RawMessage| {
        let info: SliceInfo<'_> = cdr::decode(&message.data).ok()?;
        Some(Account {
            frames: [info.first_frame, info.last_frame],
            profiles: info.frames_accepted,
            positions: [info.first_position, info.last_position],
            is_degraded: info.state >= SliceInfo::DEGRADED,
            is_last: info.last_slice,
        })
    };
    let messages = bag.messages(&Filter::topics([infos.as_str()]));
    messages.map(|message| message.ok().and_then(read).unwrap_or_default()).collect()
}
