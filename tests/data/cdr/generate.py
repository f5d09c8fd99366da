"""Writes the .cdr files beside it: python3 generate.py (needs rosbags==0.11.9). The values are repeated in
src/msg/cdr/golden.rs and src/msg/recorded_profile.rs."""

from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HERE = Path(__file__).parent
MSGS = HERE.parents[2] / "msgs/laser_profiler_msgs/msg"

store = get_typestore(Stores.ROS2_JAZZY)
for name in ("FrameTrace", "Centerline", "Profile", "SliceInfo"):
    full_name = f"laser_profiler_msgs/msg/{name}"
    store.register(get_types_from_msg((MSGS / f"{name}.msg").read_text(), full_name))

# Profile as it was before calibration_sigma_z.
FORMER_PROFILE = """
std_msgs/Header header
FrameTrace trace
uint16 stripe
float32[] x
float32[] z
float32[] intensity
uint8[] flags
float32[] sigma_z
uint32 valid_count
string calibration_id
"""
store.register(get_types_from_msg(FORMER_PROFILE, "laser_profiler_msgs/msg/FormerProfile"))


def make(kind, /, **fields):
    """A message of the kind package/Name."""
    return store.types[kind.replace("/", "/msg/")](**fields)


def write(file, message):
    """One CDR file, little endian."""
    (HERE / file).write_bytes(store.serialize_cdr(message, message.__msgtype__))


def floats(*values):
    return np.array(values, dtype=np.float32)


stamp = make("builtin_interfaces/Time", sec=1_700_000_000, nanosec=123_456_789)
header = make("std_msgs/Header", stamp=stamp, frame_id="camera")
roi = make("sensor_msgs/RegionOfInterest", x_offset=1, y_offset=2, height=3, width=4, do_rectify=True)
trace = make(
    "laser_profiler_msgs/FrameTrace",
    frame_number=2**40 + 1,
    frame_number_source=3,
    frames_missing=7,
    frames_missing_valid=True,
    encoder=-5,
    position=0.125,
    encoder_source=1,
    encoder_status=10,
    digital_inputs=513,
    exposure_time=0.5,
    receive_stamp=make("builtin_interfaces/Time", sec=-1, nanosec=999_999_999),
)
write(
    "centerline.cdr",
    make(
        "laser_profiler_msgs/Centerline",
        header=header,
        trace=trace,
        image_width=640,
        image_height=480,
        roi=roi,
        stripe_direction=2,
        method="gray_gravity/0a",
        u=floats(10, 11, 12),
        v=floats(20.25, 20.5, 30.75),
        stripe_start=np.array([0, 2], dtype=np.uint32),
        width=floats(4, 5, 6),
        intensity=floats(200, 210, 220),
        sigma=floats(),
        flags=np.array([0, 5, 16], dtype=np.uint8),
    ),
)
profile = dict(
    header=make("std_msgs/Header", stamp=stamp, frame_id="laser_plane"),
    trace=make(
        "laser_profiler_msgs/FrameTrace",
        frame_number=5,
        frame_number_source=0,
        frames_missing=0,
        frames_missing_valid=False,
        encoder=0,
        position=0.125,
        encoder_source=0,
        encoder_status=0,
        digital_inputs=0,
        exposure_time=0.5,
        receive_stamp=make("builtin_interfaces/Time", sec=0, nanosec=0),
    ),
    stripe=1,
    x=floats(0.5, 0.625, 0.75),
    z=floats(-0.25, 0, 0.25),
    intensity=floats(1, 0.5, 0.25),
    flags=np.array([0, 65, 16], dtype=np.uint8),
    sigma_z=floats(0.0625, 0.125, 0.25),
    valid_count=3,
    calibration_id="0a1b",
)
write("former_profile.cdr", make("laser_profiler_msgs/FormerProfile", **profile))
write("profile.cdr", make("laser_profiler_msgs/Profile", **profile, calibration_sigma_z=floats(0.5, 1, 2)))
write(
    "slice_info.cdr",
    make(
        "laser_profiler_msgs/SliceInfo",
        header=header,
        scan_id=make("unique_identifier_msgs/UUID", uuid=np.arange(16, dtype=np.uint8)),
        part_id="cell 7",
        slice_index=3,
        last_slice=True,
        first_frame=100,
        last_frame=199,
        first_position=-0.5,
        last_position=0.25,
        frames_expected=100,
        frames_accepted=97,
        frames_missing=2,
        frames_rejected=1,
        profiles_empty=4,
        points=2**33,
        state=1,
    ),
)
write(
    "camera_info.cdr",
    make(
        "sensor_msgs/CameraInfo",
        header=header,
        height=480,
        width=640,
        distortion_model="plumb_bob",
        d=np.array([0.1, -0.2, 0.3, -0.4, 0.5]),
        k=np.arange(9, dtype=np.float64),
        r=np.arange(9, dtype=np.float64) / 2,
        p=np.arange(12, dtype=np.float64) / 4,
        binning_x=1,
        binning_y=2,
        roi=roi,
    ),
)
write(
    "diagnostic_array.cdr",
    make(
        "diagnostic_msgs/DiagnosticArray",
        header=header,
        status=[
            make(
                "diagnostic_msgs/DiagnosticStatus",
                level=1,
                name="laser_profiler",
                message="2 frames lost",
                hardware_id="",
                values=[make("diagnostic_msgs/KeyValue", key="lost", value="2")],
            )
        ],
    ),
)
