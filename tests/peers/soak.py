"""Runs the live node for hours and measures what must stay constant: memory, open files, threads, processor time.

    cargo build --release
    target/tmp/interop-venv/bin/python tests/peers/soak.py --seconds 7200 --out soak.csv

On Zenoh the node is its own router, and `zenoh_images.py` sends it images; on DDS it is idle. Memory is the anonymous
memory of the node and of its middleware process, sampled every ten seconds; pages of the executable are left out,
because they count less while other processes run it. Its slope is that of the means of blocks, which samples taken
close together cannot make look certain; the interval is Student's, 95 %. The first tenth of the time is left out:
buffers are filled then. Prints one JSON object.
"""

import argparse
import csv
import json
import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).parent
# Quantiles of Student's t, 97.5 %, for 1 to 30 degrees of freedom.
T = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12, 2.11, 2.10, 2.09,
     2.09, 2.08, 2.07, 2.07, 2.06, 2.06, 2.06, 2.05, 2.05, 2.05, 2.04]


def family(pid):
    """The process and its children."""
    children = []
    for task in os.listdir(f"/proc/{pid}/task"):
        children += pathlib.Path(f"/proc/{pid}/task/{task}/children").read_text().split()
    return [pid, *map(int, children)]


def sample(pid):
    memory = files = threads = ticks = 0
    for process in family(pid):
        proc = pathlib.Path(f"/proc/{process}")
        for line in (proc / "smaps_rollup").read_text().splitlines():
            if line.startswith("Anonymous:"):
                memory += int(line.split()[1]) / 1024
        files += len(os.listdir(proc / "fd"))
        threads += len(os.listdir(proc / "task"))
        ticks += sum(map(int, (proc / "stat").read_text().rsplit(")", 1)[1].split()[11:13]))
    return {"memory_mb": round(memory, 3), "files": files, "threads": threads,
            "processor_s": ticks / os.sysconf("SC_CLK_TCK"), "middleware": " ".join(map(str, family(pid)[1:]))}


def slope_per_hour(samples, key, num_blocks=24):
    """Slope and half the width of its 95 % interval."""
    size = max(1, len(samples) // num_blocks)
    blocks = [samples[start:start + size] for start in range(0, len(samples) - size + 1, size)]
    if len(blocks) < 3:
        return None, None
    x = [sum(one["seconds"] for one in block) / len(block) / 3600 for block in blocks]
    y = [sum(one[key] for one in block) / len(block) for block in blocks]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    spread = sum((a - mean_x) ** 2 for a in x)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / spread
    rest = sum((b - mean_y - slope * (a - mean_x)) ** 2 for a, b in zip(x, y))
    freedom = len(x) - 2
    quantile = T[min(freedom, len(T)) - 1]
    return round(slope, 4), round(quantile * math.sqrt(rest / freedom / spread), 4)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    target = os.environ.get("CARGO_TARGET_DIR", "target")
    parser.add_argument("--executable", default=f"{target}/release/laser_profiler")
    parser.add_argument("--seconds", type=float, default=7200)
    parser.add_argument("--transport", choices=["zenoh", "dds"], default="zenoh", help="dds: with --fps 0 only")
    parser.add_argument("--fps", type=float, default=100, help="0: no images, to measure the idle node")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--period", type=float, default=10, help="seconds between two samples")
    parser.add_argument("--port", type=int, default=17448)
    parser.add_argument("--record", action="store_true", help="also record results, into a directory that is removed")
    parser.add_argument("--out", help="CSV file of the samples")
    arguments = parser.parse_args()
    if arguments.transport == "dds" and arguments.fps:
        parser.error("the images are sent on Zenoh: --transport dds needs --fps 0")
    endpoint = f"tcp/127.0.0.1:{arguments.port}"
    environment = dict(os.environ, ZENOH_CONFIG_OVERRIDE=f'listen/endpoints=["{endpoint}"]', ROS_DOMAIN_ID="77")
    with tempfile.TemporaryDirectory() as place:
        transport = ["zenoh", "--router"] if arguments.transport == "zenoh" else ["dds"]
        command = [arguments.executable, "run", "--transport", *transport, "--json", "--ros-args",
                   "-p", "recording.enabled:=" + str(arguments.record).lower(), "-p", f"recording.directory:={place}",
                   "-p", "recording.split_bytes:=100000000"]
        node = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        # Its middleware process starts a moment later.
        time.sleep(2)
        camera = None
        if arguments.fps:
            camera = subprocess.Popen(
                [sys.executable, str(HERE / "zenoh_images.py"), "send", "--connect", endpoint, "--domain", "77",
                 "--width", str(arguments.width), "--height", str(arguments.height), "--fps", str(arguments.fps),
                 "--seconds", str(arguments.seconds), "--stripe", "--linger", "5"],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        samples, begin = [], time.monotonic()
        try:
            while (seconds := time.monotonic() - begin) < arguments.seconds and node.poll() is None:
                samples.append({"seconds": round(seconds, 1), **sample(node.pid)})
                time.sleep(arguments.period)
            sent = camera.communicate()[0] if camera and node.poll() is None else "{}"
            node.send_signal(signal.SIGTERM)
            summary = json.loads(node.communicate()[0])
        finally:
            for process in filter(None, [camera, node]):
                process.kill()
    if arguments.out:
        with open(arguments.out, "w", newline="") as out:
            writer = csv.DictWriter(out, samples[0])
            writer.writeheader()
            writer.writerows(samples)
    settled = samples[len(samples) // 10:]
    slope, half_width = slope_per_hour(settled, "memory_mb")
    busy = (settled[-1]["processor_s"] - settled[0]["processor_s"]) / (settled[-1]["seconds"] - settled[0]["seconds"])
    # A replaced process begins with little memory: its curve says nothing.
    processes = {one["middleware"] for one in samples}
    print(json.dumps({
        "seconds": samples[-1]["seconds"], "exit_code": node.returncode, "sent": json.loads(sent or "{}"),
        "frames": summary.get("frames"), "memory_mb": [settled[0]["memory_mb"], settled[-1]["memory_mb"]],
        "memory_mb_per_hour": slope, "interval_95": half_width,
        "files": sorted({one["files"] for one in settled}), "threads": sorted({one["threads"] for one in settled}),
        "processor_percent": round(100 * busy, 2), "middleware_processes": len(processes)}))
    raise SystemExit(node.returncode != 0 or len(processes) != 1)


if __name__ == "__main__":
    main()
