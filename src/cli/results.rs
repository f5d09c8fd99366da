//! The point clouds of a results' recording, profile after profile.

mod cloud;
mod positions;

use std::path::Path;

use anyhow::{bail, ensure};
use nalgebra::Point3;

use crate::{
    bag::{BagReader, Filter, RawMessage, ReadOptions},
    cli::Usage,
    metrology::surface::{Region, Surface},
    msg::{
        cdr,
        laser_profiler_msgs::SliceInfo,
        schema::Message as _,
        sensor_msgs::{PointCloud2, PointField},
    },
    scanner::scan::Point,
};

/// A message may hold a slice of 2^26 points.
pub(super) const RECORD_LIMIT_BYTES: usize = (1 << 30) + (16 << 20);
/// Of any height.
pub(super) const ANY_HEIGHT_M: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
/// Most points of a surface in memory: 1.5 GiB.
const MAX_POINTS: usize = 1 << 26;

/// Which points of a recording are meant.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ResultsArgs {
    /// A recording of results: a rosbag2 directory or an .mcap file.
    pub(super) bag: std::path::PathBuf,
    /// The point clouds; the only topic of organised ones, when not given.
    #[arg(long, value_name = "TOPIC")]
    pub(super) topic: Option<String>,
    /// Number of the scan, from 0; needed where the recording has several.
    #[arg(long, value_name = "N")]
    pub(super) scan: Option<usize>,
}

/// An open recording, its clouds and where scans end in them.
pub(super) struct Results {
    pub(super) bag: BagReader,
    pub(super) topic: String,
    /// The slices of the scan that is meant, by number; those without an account belong to the last scan.
    slices: std::ops::Range<u64>,
    accounts: Vec<Account>,
}

/// The points of a region.
pub(super) struct Scanned {
    /// Row after row; without those that have no point there.
    pub(super) surface: Surface,
    /// Number of each row among the scan's profiles.
    pub(super) rows: Vec<usize>,
    pub(super) read: Read,
}

/// How reading went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Read {
    /// Profiles read.
    pub(super) profiles: u64,
    /// Clouds that could not be read.
    pub(super) rejected: u64,
}

impl Results {
    /// Opens a recording and chooses topic and scan.
    ///
    /// # Errors
    /// No recording, no clouds; [`Usage`] when nobody said which of several topics or scans.
    pub(super) fn open(args: &ResultsArgs) -> anyhow::Result<Self> {
        let options =
            ReadOptions { record_limit_bytes: RECORD_LIMIT_BYTES, ..ReadOptions::default() };
        let bag = BagReader::open(&args.bag, &options)?;
        bag.notes().iter().for_each(|note| tracing::warn!("{note}"));
        let topic = choose_topic(&bag, args.topic.as_deref(), &args.bag)?;
        let accounts = accounts(&bag, &topic);
        let last = (0_u64..).zip(&accounts).filter(|(_, account)| account.is_last);
        let ends: Vec<u64> = last.map(|(number, _)| number).collect();
        let slices = choose_scan(&ends, args.scan)?;
        Ok(Self { bag, topic, slices, accounts })
    }

    /// The topic of the profiles beside the clouds; none without.
    pub(super) fn profile_topic(&self) -> Option<String> {
        let name = format!("{}profile", self.topic.strip_suffix("points")?);
        self.bag.topics().iter().any(|topic| topic.name == name).then_some(name)
    }

    /// Whether the scan covers a frame; it may when there are no accounts.
    pub(super) fn has_frame(&self, number: u64) -> bool {
        let accounts = (0_u64..).zip(&self.accounts).filter(|(at, _)| self.slices.contains(at));
        let mut frames = accounts.map(|(_, account)| account.frames).peekable();
        frames.peek().is_none() || frames.any(|[first, last]| (first..=last).contains(&number))
    }

    /// Text of the calibration that the recording carries; none without, or when it cannot be read.
    pub(super) fn calibration(&self) -> Option<String> {
        let attached = self.bag.attachments().flatten();
        let mut files = attached.filter(|attachment| attachment.name == "calibration.yaml");
        String::from_utf8(files.next()?.data).ok()
    }

    /// Whether the stripe ran from top to bottom, by the parameters that the recording carries.
    pub(super) fn is_vertical(&self) -> bool {
        self.has_parameter("stripe_direction: vertical")
    }

    /// Whether positions were poses, by the parameters that the recording carries.
    pub(super) fn is_posed(&self) -> bool {
        self.has_parameter("motion.source: tf")
    }

    fn has_parameter(&self, line: &str) -> bool {
        let mut parameters = self.bag.metadata().flatten().filter_map(|record| {
            let text = record.entries.get("parameters")?;
            let mut lines = text.lines();
            (record.name == "laser_profiler")
                .then(|| lines.any(|found| found.trim_end().ends_with(line)))
        });
        parameters.next().unwrap_or(false)
    }

    /// Hands on every profile of the scan in the order of its frames.
    ///
    /// A cloud that cannot be read is counted and passed over.
    ///
    /// # Errors
    /// Those of `take`.
    pub(super) fn profiles(
        &self,
        mut take: impl FnMut(&[Point]) -> anyhow::Result<()>,
    ) -> anyhow::Result<Read> {
        let mut read = Read::default();
        let mut row = Vec::new();
        let messages = self.bag.messages(&Filter::topics([self.topic.as_str()]));
        for (number, message) in (0_u64..).zip(messages) {
            if !self.slices.contains(&number) {
                continue;
            }
            let mut from = |message: &RawMessage| {
                let cloud: PointCloud2<'_> = cdr::decode(&message.data)?;
                let rows = cloud::Rows::new(&cloud)?;
                for at in 0..rows.len() {
                    rows.read(at, &mut row);
                    read.profiles += 1;
                    if let Err(error) = take(&row) {
                        return Ok(Err(error));
                    }
                }
                anyhow::Ok(Ok(()))
            };
            match message.map_err(anyhow::Error::from).and_then(|message| from(&message)) {
                Ok(taken) => taken?,
                Err(error) => read.pass_over(&error),
            }
        }
        Ok(read)
    }

    /// The points of a region from the lower to the higher of two heights, metres, as a surface, rows without any left out.
    ///
    /// # Errors
    /// No such point, more points than memory should hold.
    pub(super) fn surface(
        &self,
        region: &Region,
        [low_m, high_m]: [f64; 2],
    ) -> anyhow::Result<Scanned> {
        let mut surface = Surface::default();
        let (mut rows, mut number) = (Vec::new(), 0);
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let read = self.profiles(|profile| {
            let inside = |point: &Point| {
                let [x, y, z, _] = point.map(f64::from);
                z.is_finite() && (low_m..=high_m).contains(&z) && region.contains(x, y)
            };
            number += 1;
            if !profile.iter().any(inside) {
                return Ok(());
            }
            rows.push(number - 1);
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
            where_is(region, [low_m, high_m])
        );
        Ok(Scanned { surface, rows, read })
    }
}

impl Read {
    fn pass_over(&mut self, error: &anyhow::Error) {
        self.rejected += 1;
        // One is enough to act on; the answer counts the rest.
        if self.rejected == 1 {
            tracing::warn!("passed over: {error:#}; further ones are only counted");
        }
    }

    /// Done, or done with losses.
    pub(super) fn outcome(&self) -> super::Outcome {
        if self.rejected == 0 { super::Outcome::Done } else { super::Outcome::DataLost }
    }
}

fn where_is(region: &Region, [low_m, high_m]: [f64; 2]) -> String {
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

fn choose_topic(bag: &BagReader, wanted: Option<&str>, path: &Path) -> anyhow::Result<String> {
    let clouds: Vec<&str> = bag
        .topics()
        .iter()
        .filter(|topic| topic.type_name == PointCloud2::TYPE.name)
        .map(|topic| topic.name.as_str())
        .collect();
    let path = path.display();
    if let Some(wanted) = wanted {
        let found = clouds.iter().find(|topic| **topic == wanted);
        let all = clouds.join(", ");
        let found = found.ok_or_else(|| {
            Usage(format!("{path} has no point clouds on {wanted}, only on: {all}"))
        });
        return Ok((*found?).to_owned());
    }
    // The dense twin of an organised cloud is for viewers.
    let mut own: Vec<&str> =
        clouds.iter().copied().filter(|topic| !topic.ends_with("/points_dense")).collect();
    own.dedup();
    match own[..] {
        [topic] => Ok(topic.to_owned()),
        [] => bail!(
            "{path} has no point clouds: give the results of `laser_profiler replay` with a calibration_file"
        ),
        _ => Err(Usage(format!("--topic must name one of {}", own.join(", "))).into()),
    }
}

/// What lies beside a cloud: the frames it covers, and whether a scan ends with it.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    frames: [u64; 2],
    profiles: u32,
    is_last: bool,
}

/// The accounts of the slices in their order; an unreadable one covers frame 0 and ends nothing.
fn accounts(bag: &BagReader, topic: &str) -> Vec<Account> {
    let Some(prefix) = topic.strip_suffix("points") else { return Vec::new() };
    let infos = format!("{prefix}slice_info");
    let read = |message: RawMessage| {
        let info: SliceInfo<'_> = cdr::decode(&message.data).ok()?;
        Some(Account {
            frames: [info.first_frame, info.last_frame],
            profiles: info.frames_accepted,
            is_last: info.last_slice,
        })
    };
    let messages = bag.messages(&Filter::topics([infos.as_str()]));
    messages.map(|message| message.ok().and_then(read).unwrap_or_default()).collect()
}

/// The slices of a scan.
fn choose_scan(ends: &[u64], wanted: Option<usize>) -> Result<std::ops::Range<u64>, Usage> {
    let num = ends.len().max(1);
    let scan = match wanted {
        Some(scan) if scan < num => scan,
        Some(scan) => {
            return Err(Usage(format!("--scan is {scan}, but the scans are 0 to {}", num - 1)));
        }
        None if num == 1 => 0,
        None => {
            return Err(Usage(format!(
                "there are {num} scans: --scan chooses one of 0 to {}",
                num - 1
            )));
        }
    };
    let from = if scan == 0 { 0 } else { ends[scan - 1] + 1 };
    let to = if scan + 1 == num { u64::MAX } else { ends[scan] + 1 };
    Ok(from..to)
}

/// The offset of a 32-bit float of a point.
fn float_offset(cloud: &PointCloud2<'_>, name: &str) -> Option<usize> {
    let mut fields = cloud.fields.iter();
    let field = fields.find(|field| field.name == name && field.datatype == PointField::FLOAT32)?;
    Some(field.offset as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_end_where_their_accounts_say() {
        let ends = [2, 5, 6];
        assert_eq!(choose_scan(&ends, Some(0)).unwrap(), 0..3);
        assert_eq!(choose_scan(&ends, Some(1)).unwrap(), 3..6);
        assert_eq!(choose_scan(&ends, Some(2)).unwrap(), 6..u64::MAX);
        assert_eq!(choose_scan(&ends[..1], None).unwrap(), 0..u64::MAX);
        assert_eq!(choose_scan(&[], None).unwrap(), 0..u64::MAX);
        assert!(choose_scan(&ends, None).unwrap_err().to_string().contains("0 to 2"));
        assert!(choose_scan(&ends, Some(3)).unwrap_err().to_string().contains("0 to 2"));
    }
}
