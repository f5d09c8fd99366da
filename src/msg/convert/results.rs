//! Results of one frame as messages that borrow from the scanner's buffers.

use std::borrow::Cow;

use thiserror::Error;

use crate::{
    msg::{
        builtin_interfaces::Time,
        laser_profiler_msgs::{self, FrameTrace},
        sensor_msgs,
        std_msgs::Header,
        unique_identifier_msgs::Uuid,
    },
    scanner::{
        params::{self, StripeDirection},
        profile, scan, stripe,
    },
};

/// Properties of the source frame that its results repeat.
#[derive(Clone, Debug)]
pub(crate) struct FrameSource<'a> {
    /// Header of the image.
    pub(crate) header: Header<'a>,
    /// Position of the frame in the stream.
    pub(crate) trace: FrameTrace,
    /// Columns of the image.
    pub(crate) image_width: u32,
    /// Rows of the image.
    pub(crate) image_height: u32,
    /// Region of interest.
    pub(crate) roi: params::RegionOfInterest,
    /// Direction of the stripe.
    pub(crate) stripe_direction: StripeDirection,
}

/// Returns the centreline message of a frame; `method` is the method's name, `/` and a hash of its parameters.
pub(crate) fn centerline<'a>(
    source: &'a FrameSource<'_>,
    method: &'a str,
    line: &'a stripe::Centerline,
) -> laser_profiler_msgs::Centerline<'a> {
    laser_profiler_msgs::Centerline {
        header: source.header.borrowed(),
        trace: source.trace,
        image_width: source.image_width,
        image_height: source.image_height,
        roi: region(source),
        stripe_direction: match source.stripe_direction {
            StripeDirection::Horizontal => laser_profiler_msgs::Centerline::STRIPE_HORIZONTAL,
            StripeDirection::Vertical => laser_profiler_msgs::Centerline::STRIPE_VERTICAL,
        },
        method: Cow::Borrowed(method),
        u: Cow::Borrowed(&line.u_px),
        v: Cow::Borrowed(&line.v_px),
        stripe_start: Cow::Borrowed(&line.stripe_start),
        width: Cow::Borrowed(&line.width_px),
        intensity: Cow::Borrowed(&line.intensity),
        sigma: Cow::Borrowed(&line.sigma_px),
        flags: Cow::Borrowed(&line.flags),
    }
}

/// A centreline that does not state the direction of the stripe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "the centreline does not state the direction of the stripe (stripe_direction is {0}): results of an older version, replay the \
     recording again"
)]
pub(crate) struct UnknownDirection(pub u8);

/// Returns the direction of the stripe.
///
/// # Errors
/// No valid direction, as in messages of versions without the field.
pub(crate) const fn stripe_direction(
    line: &laser_profiler_msgs::Centerline<'_>,
) -> Result<StripeDirection, UnknownDirection> {
    match line.stripe_direction {
        laser_profiler_msgs::Centerline::STRIPE_HORIZONTAL => Ok(StripeDirection::Horizontal),
        laser_profiler_msgs::Centerline::STRIPE_VERTICAL => Ok(StripeDirection::Vertical),
        value => Err(UnknownDirection(value)),
    }
}

/// Returns the region of interest with explicit sides, pixels, also if the parameters leave them open.
fn region(source: &FrameSource<'_>) -> sensor_msgs::RegionOfInterest {
    let params::RegionOfInterest { x_offset, y_offset, width, height } = source.roi;
    let side = |side: Option<u32>, offset, whole: u32| side.unwrap_or(whole.saturating_sub(offset));
    sensor_msgs::RegionOfInterest {
        x_offset,
        y_offset,
        height: side(height, y_offset, source.image_height),
        width: side(width, x_offset, source.image_width),
        do_rectify: false,
    }
}

/// Returns the profile message of a frame in the laser plane's frame `frame_id`, with the calibration's hash.
pub(crate) fn profile<'a>(
    source: &FrameSource<'_>,
    frame_id: &'a str,
    calibration_id: &'a str,
    profile: &'a profile::Profile,
) -> laser_profiler_msgs::Profile<'a> {
    laser_profiler_msgs::Profile {
        header: Header { stamp: source.header.stamp, frame_id: Cow::Borrowed(frame_id) },
        trace: source.trace,
        stripe: 0,
        x: Cow::Borrowed(&profile.x_m),
        z: Cow::Borrowed(&profile.z_m),
        intensity: Cow::Borrowed(&profile.intensity),
        flags: Cow::Borrowed(&profile.flags),
        sigma_z: Cow::Borrowed(&profile.sigma_z_m),
        valid_count: profile.valid_count,
        calibration_id: Cow::Borrowed(calibration_id),
        calibration_sigma_z: Cow::Borrowed(&profile.calibration_sigma_z_m),
    }
}

/// Returns the account of a slice of the part `part_id` in the scan frame `frame_id`; same header as its cloud.
pub(crate) fn slice_info<'a>(
    frame_id: &'a str,
    part_id: &'a str,
    slice: &scan::Slice,
) -> laser_profiler_msgs::SliceInfo<'a> {
    let account = slice.account;
    laser_profiler_msgs::SliceInfo {
        header: Header { stamp: Time::from_ns(slice.stamp_ns), frame_id: Cow::Borrowed(frame_id) },
        scan_id: Uuid { uuid: account.scan_id },
        part_id: Cow::Borrowed(part_id),
        slice_index: account.slice_index,
        last_slice: account.last_slice,
        first_frame: account.first_frame,
        last_frame: account.last_frame,
        first_position: account.first_position.0,
        last_position: account.last_position.0,
        frames_expected: account.frames_expected,
        frames_accepted: account.frames_accepted,
        frames_missing: account.frames_missing,
        frames_rejected: account.frames_rejected,
        profiles_empty: account.profiles_empty,
        points: account.points,
        state: account.state as u8,
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "values are copied, not computed")]
mod tests {
    use super::*;
    use crate::scanner::{
        axis::RawPosition,
        scan::{SliceAccount, SliceState},
    };

    fn source() -> FrameSource<'static> {
        FrameSource {
            header: Header { stamp: Time { sec: 5, nanosec: 7 }, frame_id: "camera".into() },
            trace: FrameTrace { frame_number: 42, position: 0.25, ..FrameTrace::default() },
            image_width: 640,
            image_height: 480,
            roi: params::RegionOfInterest {
                x_offset: 10,
                y_offset: 20,
                width: None,
                height: Some(100),
            },
            stripe_direction: StripeDirection::Vertical,
        }
    }

    #[test]
    fn a_centerline_names_its_frame_and_region() {
        let line = stripe::Centerline {
            u_px: vec![10.0, 11.0],
            v_px: vec![30.5, 31.25],
            stripe_start: vec![0],
            width_px: vec![4.0, f32::NAN],
            intensity: vec![200.0, 210.0],
            sigma_px: vec![0.02, 0.03],
            flags: vec![0, stripe::flag::CLIPPED],
        };
        let source = source();
        let message = centerline(&source, "gray_gravity/0123abcd", &line);
        assert_eq!(message.header, source.header);
        assert_eq!(message.trace.frame_number, 42);
        assert_eq!((message.image_width, message.image_height), (640, 480));
        let roi = message.roi;
        assert_eq!((roi.x_offset, roi.y_offset, roi.width, roi.height), (10, 20, 630, 100));
        assert_eq!(stripe_direction(&message), Ok(StripeDirection::Vertical));
        assert_eq!(message.method, "gray_gravity/0123abcd");
        assert_eq!((&*message.u, &*message.v), (&[10.0, 11.0][..], &[30.5, 31.25][..]));
        assert!(message.width[0] == 4.0 && message.width[1].is_nan());
        assert_eq!(*message.intensity, [200.0, 210.0]);
        assert_eq!((&*message.sigma, &*message.flags), (&[0.02, 0.03][..], &[0, 4][..]));
        assert_eq!(*message.stripe_start, [0]);
    }

    #[test]
    fn a_profile_has_the_image_stamp_and_the_plane_frame() {
        let points = profile::Profile {
            x_m: vec![0.001, 0.002],
            z_m: vec![0.01, 0.02],
            intensity: vec![0.5, 0.6],
            flags: vec![1, 2],
            sigma_x_m: vec![1e-7, 2e-7],
            sigma_z_m: vec![1e-6, 2e-6],
            calibration_sigma_z_m: vec![3e-6, 4e-6],
            valid_count: 2,
        };
        let source = source();
        let message = profile(&source, "laser_plane", "ab12", &points);
        assert_eq!(message.header.stamp, source.header.stamp);
        assert_eq!(message.header.frame_id, "laser_plane");
        assert_eq!((message.trace.position, message.stripe), (0.25, 0));
        assert_eq!((&*message.x, &*message.z), (&[0.001, 0.002][..], &[0.01, 0.02][..]));
        assert_eq!((&*message.intensity, &*message.flags), (&[0.5, 0.6][..], &[1, 2][..]));
        assert_eq!((&*message.sigma_z, message.valid_count), (&[1e-6, 2e-6][..], 2));
        assert_eq!(message.calibration_id, "ab12");
        assert_eq!(*message.calibration_sigma_z, [3e-6, 4e-6]);
    }

    #[test]
    fn a_slice_info_carries_the_whole_account() {
        let account = SliceAccount {
            scan_id: [8; 16],
            slice_index: 3,
            last_slice: true,
            first_frame: 300,
            last_frame: 399,
            first_position: RawPosition(0.3),
            last_position: RawPosition(0.399),
            frames_expected: 100,
            frames_accepted: 97,
            frames_missing: 2,
            frames_rejected: 1,
            profiles_empty: 4,
            profiles_standing: 0,
            points: 60_000,
            state: SliceState::Gaps,
        };
        let slice = scan::Slice { stamp_ns: -1, account, ..scan::Slice::default() };
        let message = slice_info("scan", "part 7", &slice);
        let expected = laser_profiler_msgs::SliceInfo {
            header: Header {
                stamp: Time { sec: -1, nanosec: 999_999_999 },
                frame_id: "scan".into(),
            },
            scan_id: Uuid { uuid: [8; 16] },
            part_id: "part 7".into(),
            slice_index: 3,
            last_slice: true,
            first_frame: 300,
            last_frame: 399,
            first_position: 0.3,
            last_position: 0.399,
            frames_expected: 100,
            frames_accepted: 97,
            frames_missing: 2,
            frames_rejected: 1,
            profiles_empty: 4,
            points: 60_000,
            state: laser_profiler_msgs::SliceInfo::GAPS,
        };
        assert_eq!(message, expected);
    }

    #[test]
    fn slice_states_are_those_of_the_message() {
        use laser_profiler_msgs::SliceInfo;
        assert_eq!(SliceState::Complete as u8, SliceInfo::COMPLETE);
        assert_eq!(SliceState::Gaps as u8, SliceInfo::GAPS);
        assert_eq!(SliceState::Degraded as u8, SliceInfo::DEGRADED);
        assert_eq!(SliceState::Aborted as u8, SliceInfo::ABORTED);
    }
}
