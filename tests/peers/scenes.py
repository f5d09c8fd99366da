#!/usr/bin/env python3
"""Extractors side by side on real scenes: every peer and laser_profiler on the same frames in one run.

usage: scenes.py PROGRAM DATA PEERS [--frames N]
  PROGRAM  the built laser_profiler
  DATA     directory with the recordings turntable_empty, turntable_object and robot_floor
  PEERS    directory with reference_methods.cpp and opencv_pipeline.py
needs: pip install -r scenes.requirements.txt; Debian: g++ libpng-dev

Peers have one number to set, the threshold. Each gets the one of THRESHOLDS with which it has most lines right, scene by
scene; laser_profiler gets one parameter file a scene. A colour image is given to the peers as the laser's own channel.

What is right is decided twice, never by laser_profiler: by local contrast (`contrast_line`), and by the consensus of the
peers (`consensus`). A point is right within 3 px of it. Where neither shows a line nothing is right or wrong, and a point
is counted as `unproved`.
"""
import argparse, csv, io, subprocess, sys, tempfile
from pathlib import Path

import cv2
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

THRESHOLDS = [35, 60, 90, 120, 150, 180, 210]
NEAR_PX = 3.0
# name, parameter file, vertical stripe, laser channel of BGR, least contrast of the line in grey levels, still line
SCENES = [
    ("turntable_empty", "bright_ambient.yaml", True, None, 12.0, True),
    ("turntable_object", "halo_and_wall.yaml", True, None, 25.0, False),
    ("robot_floor", "noisy_floor.yaml", False, 2, 25.0, False),
]


def images(bag):
    """All pictures of a recording, grey or BGR."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _, raw in reader.messages():
            if not connection.msgtype.endswith("Image"):
                continue
            message = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype.endswith("CompressedImage"):
                yield cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
            else:
                yield np.asarray(message.data).reshape(message.height, message.step)[:, : message.width]


def centerlines(bag):
    """Position across the stripe of every published point, by line, frame after frame."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic.endswith("/centerline"):
                yield reader.deserialize(raw, connection.msgtype)


def upright(image, vertical):
    """Rows across the stripe, one column a line."""
    return np.swapaxes(image, 0, 1) if vertical else image


def contrast_line(image, channel, least):
    """Where three pixels are brightest against the brighter one of the two sides, 6 to 16 px away, in the laser's colour
    and over three lines; NaN where that is less than `least` or leaves its neighbours: the line as a person sees it,
    found without any of the methods."""
    level = image.astype(np.float32)
    if channel is not None:
        level = level[..., channel] - (level.sum(axis=2) - level[..., channel]) / 2
    middle, side = cv2.blur(level, (3, 3)), cv2.blur(level, (3, 11))
    below, above = np.roll(side, 11, axis=0), np.roll(side, -11, axis=0)
    contrast = middle - np.maximum(below, above)
    contrast[:17] = contrast[-17:] = 0
    row = contrast.argmax(axis=0).astype(float)
    row[contrast.max(axis=0) < least] = np.nan
    return without_strays(row)


def contrast_lines(frames, scene):
    """The same for every frame. On a flat disk that turns the line stands still, so that the median of all frames has it
    and nothing that turns."""
    _, _, vertical, channel, least, is_still = scene
    if is_still:
        frames = [np.median(np.array(frames), axis=0)] * len(frames)
    return [contrast_line(np.ascontiguousarray(upright(image, vertical)), channel, least) for image in frames]


def without_strays(row):
    """A line goes on: a place that is far from most of the five to either side is none."""
    padded = np.pad(row, 5, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 11)
    agree = (np.abs(windows - row[:, None]) <= 2 * NEAR_PX).sum(axis=1)
    return np.where(agree >= 6, row, np.nan)


def consensus(rows):
    """Median of the methods, a row each, that agree within 3 px; NaN where less than half of all do."""
    best = np.full(rows.shape[1], np.nan)
    most = np.zeros(rows.shape[1], int)
    for row in rows:
        near = np.abs(rows - row) <= NEAR_PX
        count = near.sum(axis=0)
        better = (count > most) & (2 * count >= len(rows))
        middle = np.nanmedian(np.where(near, rows, np.nan)[:, better], axis=0) if better.any() else []
        best[better], most[better] = middle, count[better]
    return best


def peer(command, width):
    """The row that a program prints for every column; NaN where it prints none."""
    output = subprocess.run(command, capture_output=True, text=True)
    row = np.full(width, np.nan)
    for record in csv.DictReader(io.StringIO(output.stdout)):
        row[int(float(record["col"]))] = float(record["row"])
    return row


def figures(found, truth):
    """Right, wrong and unproved points, and lines that show a line."""
    right = np.abs(found - truth) <= NEAR_PX
    wrong = np.isfinite(found) & np.isfinite(truth) & ~right
    unproved = np.isfinite(found) & np.isnan(truth)
    return np.array([right.sum(), wrong.sum(), unproved.sum(), np.isfinite(truth).sum()])


def roughness(rows):
    """1.4826 MAD of second differences along the line, over unbroken pieces: noise, hardly shape; and jumps of more than
    3 px from one line to the next, a frame."""
    second = np.concatenate([np.diff(row, n=2) for row in rows])
    second = second[np.isfinite(second)]
    jumps = np.mean([np.nansum(np.abs(np.diff(row)) > NEAR_PX) for row in rows])
    return (1.4826 * np.median(np.abs(second - np.median(second))) if second.size else np.nan), jumps


def ours(args, scene, directory):
    """What laser_profiler publishes for every frame, one row each."""
    name, parameters, vertical = scene[:3]
    output = directory / name
    config = Path(__file__).parents[2] / "launch_configs" / parameters
    subprocess.run([args.program, "replay", args.data / name, "-o", output, "--params-file", config],
                   check=True, capture_output=True)
    lines = 480 if vertical else 640
    for message in centerlines(output):
        along, across = (message.v, message.u) if vertical else (message.u, message.v)
        row = np.full(lines, np.nan)
        # One point a line, as in the profile: the first.
        row[along[::-1].astype(int)] = across[::-1]
        yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("peers", type=Path)
    parser.add_argument("--frames", type=int, default=10, help="of each scene, evenly spread")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        directory = Path(directory)
        binary = directory / "reference_methods"
        subprocess.run(["g++", "-O3", "-march=native", args.peers / "reference_methods.cpp", "-lpng", "-o", binary],
                       check=True, capture_output=True)
        listed = subprocess.run([binary], capture_output=True, text=True).stderr
        methods = listed.split("methods:")[1].split()
        sys.path.insert(0, str(args.peers))
        import opencv_pipeline
        for scene in SCENES:
            compare(args, scene, directory, binary, methods, opencv_pipeline.improved_gravity)


def compare(args, scene, directory, binary, methods, opencv):
    name, _, vertical, channel = scene[:4]
    frames = list(images(args.data / name))
    chosen = np.unique(np.linspace(0, len(frames) - 1, args.frames).astype(int))
    profiled = list(ours(args, scene, directory))
    results = {"laser_profiler": {0: [profiled[i] for i in chosen]}}
    contrast = contrast_lines(frames, scene)
    contrast = [contrast[i] for i in chosen]
    for i in chosen:
        image = np.ascontiguousarray(upright(frames[i], vertical))
        grey = image if channel is None else np.ascontiguousarray(image[..., channel])
        picture = directory / "frame.png"
        cv2.imwrite(str(picture), grey)
        for threshold in THRESHOLDS:
            for method in methods:
                command = [binary, method, picture, "--thr", str(threshold), "--wthr", str(threshold * 50 / 35)]
                row = peer(command, grey.shape[1])
                results.setdefault(method, {}).setdefault(threshold, []).append(row)
            row = opencv(grey, segment_threshold=threshold, width_threshold=threshold * 50 / 35)
            results.setdefault("opencv_pipeline", {}).setdefault(threshold, []).append(row)
    best = {}
    for method, by_threshold in results.items():
        right = lambda threshold: sum(figures(r, t)[0] for r, t in zip(by_threshold[threshold], contrast))
        threshold = max(by_threshold, key=right)
        best[method] = (threshold, by_threshold[threshold])
    agreed = [consensus(np.array([rows[i] for method, (_, rows) in best.items() if method != "laser_profiler"]))
              for i in range(len(chosen))]
    print(f"\n### {name}: {len(chosen)} of {len(frames)} frames\n")
    print("| method | threshold | right, by contrast | wrong | unproved | right, by consensus | wrong | roughness px | jumps a frame |")
    print("|---|---|---|---|---|---|---|---|---|")
    for method, (threshold, rows) in sorted(best.items(), key=lambda item: item[0] != "laser_profiler"):
        a = sum(figures(row, truth) for row, truth in zip(rows, contrast))
        b = sum(figures(row, truth) for row, truth in zip(rows, agreed))
        rough, jumps = roughness(rows)
        print(f"| {method} | {threshold or 'file'} | {a[0] / a[3]:.1%} | {a[1] / a[3]:.1%} | {a[2] / a[3]:.1%} "
              f"| {b[0] / b[3]:.1%} | {b[1] / b[3]:.1%} | {rough:.3f} | {jumps:.1f} |", flush=True)


if __name__ == "__main__":
    main()
