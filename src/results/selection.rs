//! Selection of a scan in a results bag.

use std::{ops::Range, path::PathBuf};

use thiserror::Error;

use crate::{
    bag::BagReader,
    msg::{schema::Message as _, sensor_msgs::PointCloud2},
};

/// A scan in a results bag.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScanSelection {
    /// A rosbag2 directory or an .mcap file.
    pub(crate) bag: PathBuf,
    /// Topic of the point clouds; `None`: the only topic of organised clouds.
    pub(crate) topic: Option<String>,
    /// Number of the scan, from 0; `None`: the only scan.
    pub(crate) scan: Option<usize>,
}

/// A selection that matches no scan or several. The text names the option that resolves it.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub(crate) struct SelectionError(pub String);

/// Chooses the topic of the point clouds.
///
/// # Errors
/// No point clouds; [`SelectionError`] for a missing topic, or if several match.
pub(super) fn choose_topic(bag: &BagReader, selection: &ScanSelection) -> anyhow::Result<String> {
    let clouds: Vec<&str> = bag
        .topics()
        .iter()
        .filter(|topic| topic.type_name == PointCloud2::TYPE.name)
        .map(|topic| topic.name.as_str())
        .collect();
    let path = selection.bag.display();
    if let Some(wanted) = &selection.topic {
        if clouds.contains(&wanted.as_str()) {
            return Ok(wanted.clone());
        }
        let all = clouds.join(", ");
        let text = format!("{path} has no point clouds on {wanted}, only on: {all}");
        return Err(SelectionError(text).into());
    }
    // Dense copies of organised clouds are for viewers.
    let mut organised: Vec<&str> =
        clouds.iter().copied().filter(|topic| !topic.ends_with("/points_dense")).collect();
    organised.dedup();
    match organised[..] {
        [topic] => Ok(topic.to_owned()),
        [] => anyhow::bail!(
            "{path} has no point clouds: give the results of `laser_profiler replay` with a calibration_file"
        ),
        _ => {
            let text = format!("--topic must name one of {}", organised.join(", "));
            Err(SelectionError(text).into())
        }
    }
}

/// Returns the numbers of the slices of a scan. `ends` are the numbers of the last slice of each scan.
///
/// # Errors
/// A scan that does not exist, or several scans without a choice.
pub(super) fn choose_scan(
    ends: &[u64],
    wanted: Option<usize>,
) -> Result<Range<u64>, SelectionError> {
    let num = ends.len().max(1);
    let scan = match wanted {
        Some(scan) if scan < num => scan,
        Some(scan) => {
            let last = num - 1;
            return Err(SelectionError(format!("--scan is {scan}, but the scans are 0 to {last}")));
        }
        None if num == 1 => 0,
        None => {
            let last = num - 1;
            return Err(SelectionError(format!(
                "there are {num} scans: --scan chooses one of 0 to {last}"
            )));
        }
    };
    let from = if scan == 0 { 0 } else { ends[scan - 1] + 1 };
    let to = if scan + 1 == num { u64::MAX } else { ends[scan] + 1 };
    Ok(from..to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_end_with_their_last_slice() {
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
