#!/usr/bin/env python3
"""Time of the extraction: the benchmark and every peer on the same scene in one run, as the tables of docs/performance.md.

usage: extract.py PEERS [--all] [--bench N] [--last] [--fastest]
  PEERS    directory with reference_methods.cpp and opencv_pipeline.py
  --all    the whole benchmark, about three minutes; without it only its first group, which the peers are compared with
  --last   no new benchmark: figures of the last one
  --fastest  the fastest of criterion's samples, not their median: for a machine on which other programs run
needs: pip install -r scenes.requirements.txt; Debian: g++ libpng-dev

The scene is that of benches/extract.rs: 2592 x 2048 pixels of 8 bit, a stripe of amplitude 199, standard deviation 2.2 px,
slope 0.05, read noise 2. It is rendered here anew, so the noise differs. Everything runs on one thread, on one frame again
and again. A peer's figure is the median of the processor time of a frame, ours the median of criterion's samples of time:
when other programs run, that is to our disadvantage.
"""
import argparse, json, math, os, re, subprocess, sys, tempfile, time
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
METHODS = ["gray_gravity", "gaussian_fit", "improved_gravity", "gaussian_ml", "log_gaussian", "fir_peak", "steger"]
DEFAULT = "improved_gravity"
SIZES = ["1_mpx", "2_mpx", "5_mpx", "12_mpx", "25_mpx"]
SHARES = ["0.1_percent", "1_percent", "3_percent", "10_percent"]
# Which of our methods does what the peer does; the others are compared with the default.
COUNTERPARTS = {
    "gray_gravity": "gray_gravity", "cogwin": "gray_gravity", "firpeak": "fir_peak", "br4": "fir_peak",
    "gaussls": "log_gaussian", "gausslm": "gaussian_ml", "paper_fit": "gaussian_fit", "gauss3": "gaussian_fit",
    "steger": "steger", "steger_band": "steger",
}


def run_benchmark(everything):
    command = ["cargo", "bench", "--no-default-features", "--bench", "extract", "--"]
    command += ["--noplot"] + ([] if everything else ["^frame_2592x2048/"])
    subprocess.run(command, cwd=ROOT, check=True, stdout=sys.stderr)


def ours_us(*name):
    """Median, or minimum with --fastest, of criterion's samples in the last run, µs; NaN where that was never run."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = target.joinpath("criterion", *name, "new", "sample.json")
    if not path.exists():
        return math.nan
    sample = json.loads(path.read_text())
    ns = np.array(sample["times"]) / np.array(sample["iters"])
    return (ns.min() if "--fastest" in sys.argv else np.median(ns)) / 1e3


def render():
    """The scene as a picture: a Gaussian integrated over each pixel, noise, rounding."""
    width, height, amplitude, sigma, noise = 2592, 2048, 199.0, 2.2, 2.0
    levels = np.zeros((height, width))
    phi = lambda z: 0.5 * math.erf(z / math.sqrt(2))
    for column in range(width):
        centre = 900.0 + 0.05 * column
        for row in range(int(centre) - 20, int(centre) + 21):
            inside = phi((row + 0.5 - centre) / sigma) - phi((row - 0.5 - centre) / sigma)
            levels[row, column] = amplitude * sigma * math.sqrt(2 * math.pi) * inside
    levels += np.random.default_rng(0).normal(0.0, noise, levels.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def opencv(peers, frame, count):
    """Milliseconds of processor time a frame and points found."""
    sys.path.insert(0, str(peers))
    sys.dont_write_bytecode = True
    import opencv_pipeline
    cv2.setNumThreads(1)
    times = []
    for _ in range(count):
        start = time.process_time()
        centre = opencv_pipeline.improved_gravity(frame)
        times.append((time.process_time() - start) * 1e3)
    return np.median(times), np.isfinite(centre).sum()


def peers_ms(peers, count):
    """Name, milliseconds a frame and points found, of every peer."""
    with tempfile.TemporaryDirectory() as directory:
        picture, binary = Path(directory) / "frame.png", Path(directory) / "reference_methods"
        cv2.imwrite(str(picture), render())
        yield "opencv_pipeline", *opencv(peers, cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE), count)
        source = peers / "reference_methods.cpp"
        subprocess.run(["g++", "-O3", "-march=native", source, "-lpng", "-o", binary], check=True)
        listed = subprocess.run([binary], capture_output=True, text=True).stderr
        for method in listed.split("methods:")[1].split():
            command = [binary, method, picture, "--bench", str(count)]
            said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
            found = re.search(r"cpu_median_ms=([\d.]+).* points=(\d+)", said)
            yield f"reference_methods {method}", float(found[1]), int(found[2])


def number(value):
    if math.isnan(value):
        return "–"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def table(head, rows):
    print("\n| " + " | ".join(head) + " |\n" + "|---" * len(head) + "|")
    for name, *values in rows:
        print(f"| {name} | " + " | ".join(v if isinstance(v, str) else number(v) for v in values) + " |")


def methods_table():
    warm, cold, dense, white = ["frame_2592x2048"], ["cold_2592x2048"], ["dense_2592x2048"], ["white_2592x2048"]
    def row(method):
        us = [ours_us(*group, method) for group in (warm, cold, dense, white)]
        return [method, us[0], us[0] / ours_us(*warm, "read"), us[1], us[1] / ours_us(*cold, "read"),
                us[2], us[2] / us[0], us[3], us[3] / us[2]]
    head = ["method", "warm, µs", ": read", "cold, µs", ": read", "dense, µs", ": warm", "white, µs", ": dense"]
    table(head, map(row, ["read"] + METHODS))


def other_frames_table():
    rows = []
    for name in ["vertical", "mono16"]:
        read, us = (ours_us(f"{name}_2592x2048", method) for method in ("read", DEFAULT))
        rows.append([name, read, us, us / read])
    table(["frame", "read, µs", f"{DEFAULT}, µs", ": read"], rows)


def curves():
    rows = []
    for size in SIZES:
        read, us = (ours_us("frame_size", method, size) for method in ("read", DEFAULT))
        rows.append([size.replace("_mpx", ""), read, us, us / read, us - read])
    table(["Mpx", "read, µs", f"{DEFAULT}, µs", ": read", "less one read, µs"], rows)
    rows = []
    for share in SHARES:
        read, us, dense = (ours_us("bright_share", what, share) for what in ("read", "skipping", "dense"))
        rows.append([share.replace("_percent", " %"), read, us, us / read, dense, us / dense])
    table(["bright pixels", "read, µs", f"{DEFAULT}, µs", ": read", "nothing left out, µs", "ratio"], rows)


def peers_table(peers, count):
    def row(name, ms, points):
        counterpart = COUNTERPARTS.get(name.split()[-1], DEFAULT)
        ours_ms = ours_us("frame_2592x2048", counterpart) / 1e3
        return [name, ms, str(points), counterpart, ours_ms, ms / ours_ms]
    head = ["peer", "ms", "points", "our method", "ms", "peer : ours"]
    table(head, [row(*peer) for peer in peers_ms(peers, count)])


def main():
    formatter = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=formatter, allow_abbrev=False)
    parser.add_argument("peers", type=Path)
    parser.add_argument("--all", action="store_true", help="the whole benchmark")
    parser.add_argument("--bench", type=int, default=20, help="frames of every peer")
    parser.add_argument("--last", action="store_true", help="no new benchmark")
    parser.add_argument("--fastest", action="store_true", help="of criterion's samples")
    args = parser.parse_args()
    if not args.last:
        run_benchmark(args.all)
    if args.all:
        methods_table()
        other_frames_table()
        curves()
    peers_table(args.peers, args.bench)


if __name__ == "__main__":
    main()
