//! The pictures from which an axis is calibrated.

use anyhow::bail;

use super::{
    args::AxisArgs,
    joint::{self, Joint, Source},
    pictures::{self, Pictures, View},
    rejected::{self, Rejected},
    stripes,
};
use crate::{
    calibrate::{AxisTarget, AxisTargetDetector, AxisView},
    cli::settings::Settings,
};

/// The pictures that are used, and those that are rejected.
pub(super) struct AxisPictures {
    /// Names of the pictures.
    pub(super) names: Vec<String>,
    /// The pictures, in the order of their names.
    pub(super) views: Vec<AxisView>,
    /// Rejected pictures.
    pub(super) rejected: Vec<Rejected>,
    /// True if pictures could not be read.
    pub(super) is_lossy: bool,
}

/// Finds the target, the stripe and the stated position of every picture.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for no topic of positions, or several; a topic without any usable message.
pub(super) fn find(
    args: &AxisArgs,
    pictures: &Pictures,
    settings: &Settings,
    target: &AxisTarget,
) -> anyhow::Result<AxisPictures> {
    let source = joint::source(args, pictures)?;
    let detector = AxisTargetDetector::new(target)?;
    let finder = stripes::finder(settings, &pictures.params);
    let mut joint = Joint::new(args.joint.clone(), &pictures.params.scanner.motion);
    let topic = match &source {
        Source::Topic(topic) => Some(topic.as_str()),
        Source::Step(_) | Source::Table(_) => None,
    };
    let mut joint_error = None;
    let on_other = |message: &_| {
        let taken = joint.take(message);
        taken.inspect_err(|error| {
            joint_error.get_or_insert_with(|| format!("{error:#}"));
        })
    };
    let seen = pictures.map_beside(topic, on_other, |image| {
        let target = match detector.detect(&pictures::gray(image, &pictures.params.scanner)) {
            Ok(target) => target,
            Err(rejected) => return Ok(Err(rejected.to_string())),
        };
        let stripes = finder.find(image).map_err(|error| error.to_string())?;
        let size_px = [image.width(), image.height()];
        // Positions are complete only after all messages have been read.
        Ok(Ok(AxisView { size_px, stated: f64::NAN, target, stripes }))
    });
    joint.settle();
    if topic.is_some() && joint.is_empty() {
        bail!(joint_error.unwrap_or_else(|| "the joint's topic has no messages".to_owned()));
    }
    Ok(AxisPictures::sort(seen, |index, name, stamp_ns| match &source {
        Source::Topic(_) => joint.at(stamp_ns),
        of_pictures => of_pictures.of_picture(name, index),
    }))
}

impl AxisPictures {
    fn sort(
        seen: Vec<View<Result<AxisView, String>>>,
        position: impl Fn(usize, &str, i64) -> Option<f64>,
    ) -> Self {
        let mut sorted =
            Self { names: Vec::new(), views: Vec::new(), rejected: Vec::new(), is_lossy: false };
        for (index, View { name, stamp_ns, result }) in seen.into_iter().enumerate() {
            sorted.is_lossy |= result.is_err();
            match (result.and_then(|seen| seen), position(index, &name, stamp_ns)) {
                (Err(reason), _) => sorted.rejected.push(Rejected::new(name, reason)),
                (Ok(_), None) => {
                    let reason = "no position is stated for it";
                    sorted.rejected.push(Rejected::new(name, reason));
                }
                (Ok(view), Some(stated)) => {
                    sorted.names.push(name);
                    sorted.views.push(AxisView { stated, ..view });
                }
            }
        }
        sorted
    }

    /// Lists the number of pictures and the reasons for rejections.
    pub(super) fn summary(&self) -> String {
        format!(
            "pictures used: {}, not used: {}\n{}",
            self.names.len(),
            self.rejected.len(),
            rejected::text(&self.rejected)
        )
    }
}
