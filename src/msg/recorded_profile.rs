//! Reads recorded profiles, of this version and of versions before `calibration_sigma_z`.
//!
//! CDR states neither names nor types of fields. The recording's definition decides which layout its messages have.

use std::borrow::Cow;

use serde::Deserialize;
use thiserror::Error;

use super::{
    cdr::{self, CdrError},
    laser_profiler_msgs::{FrameTrace, Profile},
    schema::Message as _,
    std_msgs::Header,
    text,
};

/// Type hash of the definition without `calibration_sigma_z`.
const FORMER_HASH: &str = "RIHS01_6ae9c3a296bad0a4be78cf73576c8a554044f25f2fb0d33e021a3b74d0342220";

/// How a recording defines its profiles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StatedDefinition<'a> {
    /// Type hash (`RIHS01_…`), or empty.
    pub(crate) hash: &'a str,
    /// Fields in the `.msg` language, followed by those of its dependencies; or empty.
    pub(crate) text: &'a str,
}

/// Reason to refuse a recorded profile.
#[derive(Debug, Error)]
pub(crate) enum ProfileError {
    /// A definition of neither this nor an older version.
    #[error(
        "{} is defined differently in this recording, as {stated}: a newer version wrote it, or it is another type",
        Profile::TYPE.name
    )]
    Definition {
        /// The definition's hash, or its fields.
        stated: String,
    },
    /// The bytes are not a profile.
    #[error(transparent)]
    Cdr(#[from] CdrError),
}

/// The layouts that versions of this program wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Current,
    Former,
    /// The recording states no definition.
    Unknown,
}

/// A profile before `calibration_sigma_z`.
#[derive(Deserialize)]
struct FormerProfile<'a> {
    #[serde(borrow)]
    header: Header<'a>,
    trace: FrameTrace,
    stripe: u16,
    x: Cow<'a, [f32]>,
    z: Cow<'a, [f32]>,
    intensity: Cow<'a, [f32]>,
    #[serde(borrow, with = "serde_bytes")]
    flags: Cow<'a, [u8]>,
    sigma_z: Cow<'a, [f32]>,
    valid_count: u32,
    #[serde(borrow, with = "text")]
    calibration_id: Cow<'a, str>,
}

/// Reads a profile as its recording defines it. Without a definition, bytes that are no complete profile of this version
/// are read as one of the former layout, which must then be complete. In that layout `calibration_sigma_z` is empty.
///
/// # Errors
/// A definition of neither this nor an older version; bytes that do not agree with the definition.
pub(crate) fn decode<'a>(
    stated: StatedDefinition<'_>,
    bytes: &'a [u8],
) -> Result<Profile<'a>, ProfileError> {
    match layout(stated)? {
        Layout::Current => Ok(cdr::decode(bytes)?),
        Layout::Former => Ok(former(bytes)?),
        Layout::Unknown => {
            let current = cdr::decode(bytes);
            Ok(current.or_else(|error| former(bytes).or(Err(error)))?)
        }
    }
}

fn former(bytes: &[u8]) -> Result<Profile<'_>, CdrError> {
    let former: FormerProfile<'_> = cdr::decode_named(Profile::TYPE.name, bytes)?;
    Ok(Profile {
        header: former.header,
        trace: former.trace,
        stripe: former.stripe,
        x: former.x,
        z: former.z,
        intensity: former.intensity,
        flags: former.flags,
        sigma_z: former.sigma_z,
        valid_count: former.valid_count,
        calibration_id: former.calibration_id,
        calibration_sigma_z: Cow::default(),
    })
}

/// Returns the layout of a definition: by its hash, which includes dependencies, otherwise by its fields.
fn layout(stated: StatedDefinition<'_>) -> Result<Layout, ProfileError> {
    let StatedDefinition { hash, text } = stated;
    if hash == Profile::TYPE.hash {
        return Ok(Layout::Current);
    }
    if hash == FORMER_HASH {
        return Ok(Layout::Former);
    }
    if !hash.is_empty() {
        return Err(ProfileError::Definition { stated: hash.to_owned() });
    }
    if text.is_empty() {
        return Ok(Layout::Unknown);
    }
    let (fields, known) = (fields(text), fields(Profile::TYPE.text));
    if fields == known {
        return Ok(Layout::Current);
    }
    if known.split_last().is_some_and(|(_, former)| fields == former) {
        return Ok(Layout::Former);
    }
    Err(ProfileError::Definition { stated: fields.join(", ") })
}

/// Returns the fields of the first message of a definition, each as `type name`; constants and comments are left out.
fn fields(definition: &str) -> Vec<String> {
    let lines = definition.lines().take_while(|line| !line.starts_with("===="));
    let code = lines.map(|line| line.split('#').next().unwrap_or_default());
    let fields = code.filter(|code| !code.trim().is_empty() && !code.contains('='));
    fields.map(|code| code.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::builtin_interfaces::Time;

    const CURRENT: &[u8] = include_bytes!("../../tests/data/cdr/profile.cdr");
    const FORMER: &[u8] = include_bytes!("../../tests/data/cdr/former_profile.cdr");

    /// The values of `tests/data/cdr/generate.py`.
    fn profile(calibration_sigma_z: &'static [f32]) -> Profile<'static> {
        Profile {
            header: Header {
                stamp: Time { sec: 1_700_000_000, nanosec: 123_456_789 },
                frame_id: "laser_plane".into(),
            },
            trace: FrameTrace {
                frame_number: 5,
                position: 0.125,
                exposure_time: 0.5,
                ..FrameTrace::default()
            },
            stripe: 1,
            x: [0.5, 0.625, 0.75].as_slice().into(),
            z: [-0.25, 0.0, 0.25].as_slice().into(),
            intensity: [1.0, 0.5, 0.25].as_slice().into(),
            flags: [0, 65, 16].as_slice().into(),
            sigma_z: [0.0625, 0.125, 0.25].as_slice().into(),
            valid_count: 3,
            calibration_id: "0a1b".into(),
            calibration_sigma_z: calibration_sigma_z.into(),
        }
    }

    fn former_text() -> String {
        let text = Profile::TYPE.schema();
        text.replace("float32[] calibration_sigma_z\n", "")
    }

    fn stated<'a>(hash: &'a str, text: &'a str) -> StatedDefinition<'a> {
        StatedDefinition { hash, text }
    }

    #[test]
    fn messages_are_read_as_their_definition_says() {
        let schema = Profile::TYPE.schema();
        let former_text = former_text();
        let now = profile(&[0.5, 1.0, 2.0]);
        for definition in
            [stated(Profile::TYPE.hash, &schema), stated("", &schema), StatedDefinition::default()]
        {
            assert_eq!(decode(definition, CURRENT).unwrap(), now);
        }
        for definition in [
            stated(FORMER_HASH, &former_text),
            stated("", &former_text),
            StatedDefinition::default(),
        ] {
            assert_eq!(decode(definition, FORMER).unwrap(), profile(&[]), "{definition:?}");
        }
        let mut written = Vec::new();
        cdr::encode(&now, &mut written).unwrap();
        assert_eq!(written, CURRENT);
    }

    /// Writers may pad a message.
    #[test]
    fn padding_of_the_former_layout_is_no_array() {
        for padding in 1..=7 {
            let padded = [FORMER, &[0; 7][..padding]].concat();
            for definition in [stated(FORMER_HASH, ""), StatedDefinition::default()] {
                assert_eq!(decode(definition, &padded).unwrap(), profile(&[]), "{padding}");
            }
        }
    }

    #[test]
    fn other_definitions_are_refused_by_name() {
        let schema = Profile::TYPE.schema();
        let swapped = schema.replace("float32[] x\nfloat32[] z\n", "float32[] z\nfloat32[] x\n");
        let longer =
            schema.replace("string calibration_id\n", "string calibration_id\nuint8 extra\n");
        let wider = schema.replace("uint16 stripe", "uint32 stripe");
        let foreign = format!("RIHS01_{}", "0".repeat(64));
        for (hash, text) in
            [("", &swapped), ("", &longer), ("", &wider), (foreign.as_str(), &schema)]
        {
            assert!(!hash.is_empty() || *text != schema, "the text was changed");
            let error = decode(stated(hash, text), CURRENT).unwrap_err().to_string();
            assert!(error.contains("laser_profiler_msgs/msg/Profile is defined diff"), "{error}");
        }
    }

    #[test]
    fn bytes_that_contradict_their_definition_are_refused() {
        assert!(decode(stated(FORMER_HASH, ""), CURRENT).is_err());
        assert!(decode(stated(Profile::TYPE.hash, ""), FORMER).is_err());
        // Cut off within the last array.
        for cut in 1..12 {
            let bytes = &CURRENT[..CURRENT.len() - cut];
            assert!(decode(stated(Profile::TYPE.hash, ""), bytes).is_err(), "{cut}");
        }
    }
}
