"""Opens a recording in Rerun without a window, goes to a time, takes a picture and prints as JSON what is seen of each
view: how many pixels of each strong colour, by hue in steps of 30 degrees, and what the viewer complains of."""

import argparse
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

# Software rendering on a busy machine.
PATIENCE_S = 180


def patiently(act):
    """Asks again until it is done: the viewer starts, loads and draws beside us."""
    limit = time.monotonic() + PATIENCE_S
    while True:
        try:
            return act()
        except (RuntimeError, TimeoutError, ConnectionError):
            if time.monotonic() > limit:
                raise
            time.sleep(1)


def hues(path):
    pixels = np.asarray(Image.open(path).convert("HSV")).reshape(-1, 3)
    strong = pixels[(pixels[:, 1] >= 128) & (pixels[:, 2] >= 80)]
    steps = np.round(strong[:, 0] / 256 * 12).astype(int) % 12
    return {str(30 * step): int(count) for step, count in enumerate(np.bincount(steps, minlength=12)) if count}


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def look(client, options):
    """Goes to the time and looks at every view; the first picture of a place may be taken before it is drawn."""
    recording = patiently(client.get_state).recordings[0]
    (timeline,) = (line for line in recording.timelines if line.name == "stamp")
    at = np.datetime64(timeline.start + round(1e9 * options.seconds), "ns")
    patiently(lambda: client.set_time("stamp", timestamp=at, play_state="paused"))
    time.sleep(3)
    patiently(lambda: client.save_screenshot(str(options.picture)))
    # Colours of a table make it small enough for a document.
    Image.open(options.picture).convert("RGB").quantize(256).save(options.picture, optimize=True)
    seen = {}
    with tempfile.TemporaryDirectory() as place:
        for view in patiently(client.get_state).views:
            picture = f"{place}/{view.view_id}.png"
            patiently(lambda: client.save_screenshot(picture, view.view_id))
            seen[view.name] = {"hues": hues(picture), "reports": [str(report) for report in view.reports]}
    return {"timeline_ns": [timeline.start, timeline.end], "views": seen}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, required=True, help="time after the start of the recording")
    parser.add_argument("--picture", type=pathlib.Path, required=True)
    options = parser.parse_args()
    port = free_port()
    program = shutil.which("rerun", path=pathlib.Path(sys.executable).parent)
    arguments = ["--headless", "--port", str(port), "--bind", "127.0.0.1", "--window-size", "1000x640"]
    # The program starts another one: both end as one group.
    viewer = subprocess.Popen([program, *arguments], stdout=sys.stderr, start_new_session=True)
    try:
        client = patiently(lambda: ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy"))
        patiently(lambda: client.open(str(options.recording.resolve())))
        print(json.dumps(look(client, options)))
    finally:
        os.killpg(viewer.pid, signal.SIGTERM)
        viewer.wait()


if __name__ == "__main__":
    main()
