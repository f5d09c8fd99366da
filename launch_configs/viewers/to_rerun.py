#!/usr/bin/env python3
"""Turns a results bag of laser_profiler into a Rerun recording with its layout (blueprint).

The recording contains the images in grey with the centreline, each profile, the points coloured by height in one growing
cloud, the height map, the quality of each frame (points, sigma of z) and the counters of the stream.
"""

import argparse
import pathlib
import sys

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from mcap.exceptions import McapError
from mcap_ros2.reader import read_ros2_messages

EXAMPLE = """\
Needs      pip install rerun-sdk==0.41.0 mcap-ros2-support==0.6.0 numpy
Example    laser_profiler replay bags/film_defects -o film --with-images --params-file bags/film_defects.params.yaml
           python3 launch_configs/viewers/to_rerun.py film -o film.rrd --heights 5.2 7
           rerun film.rrd
Live bags store images apart from results: pass both, `to_rerun.py results images -o scan.rrd`."""
TIME = "stamp"
GREEN, BLUE = (60, 230, 80), (78, 152, 226)
# From low to high: dark blue, cyan, green, yellow, red.
COLOURS = np.array([[50, 40, 140], [40, 170, 220], [110, 220, 90], [250, 200, 50], [200, 30, 20]])
IMAGE_TYPES = {"mono8": np.uint8, "mono16": np.uint16, "8UC1": np.uint8, "16UC1": np.uint16}


def files(place):
    """The MCAP files of a bag, in order: of a rosbag2 directory or a bare file."""
    found = sorted(place.glob("*.mcap")) if place.is_dir() else [place]
    if not found or not found[0].exists():
        raise SystemExit(f"to_rerun.py: {place}: no recording (.mcap) there")
    return found


def at(header):
    """Sets the time of the next log calls: the middle of the exposure."""
    rr.set_time(TIME, timestamp=np.datetime64(header.stamp.sec * 10**9 + header.stamp.nanosec, "ns"))


def image(message):
    kind = np.dtype(IMAGE_TYPES[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    pixels = np.ascontiguousarray(rows[:, : message.width * kind.itemsize]).view(kind)
    rr.log("camera/image", rr.Image(pixels.astype(kind.newbyteorder("=")), "L"))


def centerline(message):
    # Rerun puts (0, 0) at the corner of the first pixel, the message at its centre.
    points = np.column_stack([message.u, message.v]) + 0.5
    rr.log("camera/centerline", rr.LineStrips2D(pieces(points), colors=GREEN, radii=rr.Radius.ui_points(1)))


def profile(message):
    points_mm = 1e3 * np.column_stack([message.x, message.z])
    rr.log("profile", rr.LineStrips2D(pieces(points_mm * [1, -1]), colors=BLUE, radii=rr.Radius.ui_points(1)))
    rr.log("quality/points", rr.Scalars(float(message.valid_count)))
    sigmas = np.asarray(message.sigma_z, np.float64)
    if np.isfinite(sigmas).any():
        rr.log("quality/sigma_z_um", rr.Scalars(1e6 * float(np.nanmedian(sigmas))))


def pieces(points):
    """Line segments through neighbouring points, split at missing points and at steps."""
    points = points[np.isfinite(points).all(axis=1)]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    gaps = np.flatnonzero(steps > 4 * np.median(steps)) + 1 if len(steps) else []
    return [line for line in np.split(points, gaps) if len(line) > 1]


def cloud(message, place, heights_mm, bounds_mm):
    points_mm = 1e3 * np.frombuffer(bytes(message.data), np.float32).reshape(-1, 4)[:, :3]
    share = np.clip((points_mm[:, 2] - heights_mm[0]) / (heights_mm[1] - heights_mm[0]), 0, 1)
    steps = np.linspace(0, 1, len(COLOURS))
    colours = np.column_stack([np.interp(share, steps, channel) for channel in COLOURS.T]).astype(np.uint8)
    rr.log(place, rr.Points3D(points_mm, colors=colours, radii=rr.Radius.ui_points(2)))
    bounds_mm += [points_mm.min(axis=0), points_mm.max(axis=0)] if len(points_mm) else []


def height_map(message, heights_mm):
    heights = 1e3 * np.frombuffer(bytes(message.data), np.float32).reshape(message.height, message.width)
    heights = np.nan_to_num(heights, nan=heights_mm[0])
    rr.log("height_map", rr.DepthImage(heights, meter=1e3, colormap="turbo", depth_range=heights_mm))


def status(message):
    for name in ["lost_upstream", "lost_transport", "dropped_overload", "rejected_malformed"]:
        rr.log(f"stream/{name}", rr.Scalars(float(getattr(message, name))))


def blueprint(bounds_mm):
    """One window: camera, profile and height map on the left, points and figures on the right."""
    low, high = (np.min(bounds_mm, axis=0), np.max(bounds_mm, axis=0)) if bounds_mm else (np.zeros(3), np.ones(3))
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    eye = rrb.EyeControls3D(position=middle + size * np.array([0.25, -0.55, 0.6]), look_target=middle, eye_up=(0, 0, 1))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial2DView(origin="camera", name="Stripe and centreline"),
                rrb.Spatial2DView(origin="profile", name="Profile: x right, z up [mm]"),
                rrb.Spatial2DView(origin="height_map", name="Height map"),
            ),
            rrb.Vertical(
                rrb.Spatial3DView(origin="points", name="Points by height [mm]", eye_controls=eye),
                rrb.Horizontal(
                    rrb.TimeSeriesView(origin="quality/sigma_z_um", name="Median sigma of z [µm]"),
                    rrb.TimeSeriesView(origin="stream", name="Lost frames"),
                ),
                row_shares=[2, 1],
            ),
            column_shares=[2, 3],
        ),
        rrb.TimePanel(timeline=TIME, state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLE, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", nargs="+", type=pathlib.Path, help="rosbag2 directory or .mcap file; several of one run")
    parser.add_argument("-o", "--output", required=True, help="recording to write, .rrd")
    parser.add_argument("--node", default="/laser_profiler", help="name of the node; default %(default)s")
    parser.add_argument("--images", help="topic of the images; without it the first of type sensor_msgs/Image")
    parser.add_argument(
        "--heights", nargs=2, type=float, default=[0, 10], metavar=("LOW", "HIGH"),
        help="heights of the lowest and the highest colour, mm; default 0 10",
    )
    options = parser.parse_args()
    if options.heights[0] >= options.heights[1]:
        parser.error("--heights: LOW must be below HIGH")
    recording = rr.RecordingStream("laser_profiler")
    recording.save(options.output)
    counts, options.bounds_mm, options.is_damaged = {}, [], False
    with recording:
        for path in (path for bag in options.bag for path in files(bag)):
            try:
                for message in read_ros2_messages(path):
                    show(message.channel.topic, message.schema.name, message.ros_msg, options, counts)
            except McapError as error:
                # What was read stays; nobody takes the rest for all there is.
                print(f"to_rerun.py: {path}: damaged ({error}); `laser_profiler recover` saves the rest", file=sys.stderr)
                options.is_damaged = True
        rr.send_blueprint(blueprint(options.bounds_mm))
    print(f"{options.output}: " + (", ".join(f"{number} {name}" for name, number in counts.items()) or "nothing"))
    if "profile" not in counts and "centerline" not in counts:
        sys.exit(f"to_rerun.py: no results of the node {options.node} in these recordings; --node names another")
    sys.exit(3 if options.is_damaged else 0)


def show(topic, kind, message, options, counts):
    """Logs a message by the name of its topic; others are passed over."""
    name = topic.removeprefix(f"{options.node}/")
    shown = {"centerline": centerline, "profile": profile, "stream_status": status}
    if name == topic:
        options.images = options.images or (topic if kind == "sensor_msgs/msg/Image" else None)
        if topic != options.images:
            return
        name, act = ("image", image) if message.encoding in IMAGE_TYPES else (f"{message.encoding} not shown", None)
    elif name in shown:
        act = shown[name]
    elif name == "points_dense":
        # A place of its own for every slice: they add up to the cloud.
        act = lambda message: cloud(message, f"points/{counts.get(name, 0):05}", options.heights, options.bounds_mm)
    elif name == "height_map":
        act = lambda message: height_map(message, options.heights)
    else:
        return
    if act:
        at(message.header)
        act(message)
    counts[name] = counts.get(name, 0) + 1


if __name__ == "__main__":
    main()
