"""Looks at a live view as a person would: `check_view.py ws://HOST:PORT WHAT [MORE]`; prints figures as JSON."""

import json
import sys
import time

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from viewer import ENDED, PAUSED, PLAYING, Viewer, stamp_ns
from websockets.exceptions import InvalidHandshake, InvalidMessage

NODE = "/laser_profiler"
PREVIEW, OVERLAY = f"{NODE}/preview", f"{NODE}/preview_annotations"
LINE, DRAWN = f"{NODE}/centerline", f"{NODE}/annotations"
THRESHOLD = "extraction.segment_threshold"
PLAY, PAUSE = 0, 1


def paused(url, *topics):
    """A viewer of a recording that stands still, with those topics, and the times of the recording."""
    viewer = Viewer(url)
    viewer.control(PAUSE)
    viewer.subscribe(*topics)
    viewer.drain()
    times = (viewer.info[f"data{end}Time"] for end in ("Start", "End"))
    return viewer, tuple(time["sec"] * 10**9 + time["nsec"] for time in times)



def seek(viewer, time_ns, *topics):
    """Jumps there; waits for the topics."""
    viewer.forget()
    state = viewer.control(PAUSE, seek=time_ns)
    assert state[0] == PAUSED and state[3], state
    viewer.wait(lambda: all(topic in viewer.messages for topic in topics))
    viewer.drain(0.1)


def recorded(results, topic):
    """The messages of a bag of results: log times and what is in them."""
    with open(results, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = reader.iter_decoded_messages(topics=[topic])
        return [(message.log_time, ros) for _, _, message, ros in decoded]


def points(annotations):
    return [(point.x, point.y) for line in annotations.points for point in line.points]


def topics(url):
    viewer = Viewer(url)
    expected = ["centerline", "annotations", "stream_status", "profile", "points", "points_dense"]
    expected += ["slice_info", "height_map", "preview", "preview_annotations"]
    viewer.wait(lambda: all(f"{NODE}/{name}" in viewer.channels for name in expected))
    viewer.wait(lambda: "/diagnostics" in viewer.channels)
    for channel in viewer.channels.values():
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg"), channel
        assert channel["schema"] and "/msg/" in channel["schemaName"], channel
    assert {"time", "playbackControl", "parameters"} <= set(viewer.info["capabilities"])
    viewer.send(op="getParameters", parameterNames=[], id="all")
    viewer.wait(lambda: viewer.parameters)
    return {"topics": sorted(viewer.channels), "parameters": len(viewer.parameters)}


def overlay(url):
    """The drawn line lies on the bright stripe of the picture it belongs to."""
    viewer, (start, end) = paused(url, PREVIEW, OVERLAY)
    shares = []
    for part in range(1, 5):
        seek(viewer, start + (end - start) * part // 5, PREVIEW, OVERLAY)
        picture, drawn = viewer.last(PREVIEW), viewer.last(OVERLAY)
        assert picture.encoding == "mono8" and 0 < picture.width <= 640
        assert len(picture.data) == picture.step * picture.height
        stamp = drawn.points[0].timestamp
        assert (stamp.sec, stamp.nanosec) == (picture.header.stamp.sec, picture.header.stamp.nanosec)
        mean = sum(picture.data) / len(picture.data)
        levels = [picture.data[int(y) * picture.step + int(x)] for x, y in points(drawn)]
        bright = [level > 3 * mean + 20 for level in levels]
        assert len(levels) > picture.width / 2
        shares.append(sum(bright) / len(bright))
    assert min(shares) > 0.95, shares
    return {"on_the_stripe": min(shares)}


def jumps(url, results):
    """Any frame, in any order, is shown as the results have it."""
    viewer, (start, end) = paused(url, LINE)
    truth = recorded(results, LINE)
    for index in [len(truth) // 2, 3, len(truth) - 1, 0, len(truth) // 3]:
        time_ns, expected = truth[index]
        # A nanosecond behind the frame before: the next one is meant.
        seek(viewer, truth[index - 1][0] + 1 if index else 0, LINE)
        (shown_ns, shown), = viewer.messages[LINE]
        assert shown_ns == time_ns, (index, shown_ns, time_ns)
        assert (list(shown.u), list(shown.v)) == (list(expected.u), list(expected.v)), index
        assert viewer.states[-1][1] == time_ns and viewer.times[-1] == time_ns
    seek(viewer, end + 10**12, LINE)
    assert viewer.messages[LINE][-1][0] == truth[-1][0], "behind the end the last frame is shown"
    return {"frames": len(truth)}


def plays(url):
    """Plays to the end at ten times the speed; every frame is there once; then again from the start."""
    viewer, (start, end) = paused(url, LINE, f"{NODE}/height_map")
    viewer.forget()
    began = time.monotonic()
    state = viewer.control(PLAY, speed=10.0, seek=start)
    assert state[0] == PLAYING and abs(state[2] - 10.0) < 1e-6
    viewer.wait(lambda: any(state[0] == ENDED for state in viewer.states), 60)
    # The end of the recording ends the scan. States come on another way than messages, and may pass them.
    viewer.wait(lambda: f"{NODE}/height_map" in viewer.messages)
    seconds = time.monotonic() - began
    lines = [time_ns for time_ns, _ in viewer.messages[LINE]]
    assert lines == sorted(set(lines)), "every frame once"
    viewer.forget()
    state = viewer.control(PLAY)
    assert state[3] and state[1] == start, "who plays on from the end begins again"
    viewer.wait(lambda: LINE in viewer.messages)
    assert viewer.messages[LINE][0][0] == lines[0]
    viewer.control(PAUSE)
    return {"frames": len(lines), "seconds": seconds, "recorded": (end - start) / 1e9}


def tuning(url):
    """A parameter that is set while the recording stands still changes the line over the picture at once."""
    viewer, (start, end) = paused(url, DRAWN)
    seek(viewer, (start + end) // 2, DRAWN)
    before, used = points(viewer.last(DRAWN)), []
    assert before
    for value in [254.0, 35.0, 254, 35]:
        viewer.forget()
        began = time.monotonic()
        in_force = viewer.set(THRESHOLD, value)
        assert in_force == value and not viewer.errors, (in_force, viewer.errors)
        viewer.wait(lambda: DRAWN in viewer.messages)
        used.append(time.monotonic() - began)
        viewer.drain(0.1)
        after = points(viewer.last(DRAWN))
        assert (after == before) if value == 35 else (after != before), value
    refused(viewer)
    return {"ms": sorted(1e3 * seconds for seconds in used)[len(used) // 2]}


def refused(viewer):
    for name, value, words in [
        (THRESHOLD, -1.0, "must be a float from"),
        ("extraction.method", "best", "one of "),
        ("autostart", False, "read-only"),
    ]:
        viewer.forget()
        viewer.set(name, value)
        viewer.wait(lambda: viewer.errors)
        assert words in viewer.errors[0] and name in viewer.errors[0], viewer.errors
        assert viewer.parameters[name] != value, "the panel shows what is in force"
    viewer.forget()
    viewer.send(op="setParameters", parameters=[{"name": "bogus", "value": 1}], id="bogus")
    viewer.wait(lambda: viewer.errors)
    assert "no parameter is called" in viewer.errors[0], viewer.errors


def old(url):
    """A viewer of an earlier protocol is turned away."""
    for _ in range(3):
        try:
            Viewer(url, protocol="foxglove.websocket.v1")
        except (InvalidHandshake, InvalidMessage, EOFError):
            continue
        raise AssertionError("an old viewer was let in")
    return topics(url)


def as_recorded(url, expected):
    """A recording without images: what it holds is shown, and what is missing is told."""
    viewer, (start, end) = paused(url, LINE)
    viewer.wait(lambda: viewer.errors)
    assert "no images" in " ".join(viewer.errors), viewer.errors
    truth = recorded(expected, LINE)
    seek(viewer, truth[len(truth) // 2][0], LINE)
    assert viewer.messages[LINE][-1][0] == truth[len(truth) // 2][0]
    return {"frames": len(truth)}


def slow(url, seconds):
    """Five viewers of everything that read nothing."""
    viewers = [Viewer(url) for _ in range(5)]
    for viewer in viewers:
        viewer.wait(lambda viewer=viewer: LINE in viewer.channels)
        viewer.drain(0.1)
        viewer.subscribe(*viewer.channels)
    print("subscribed", flush=True)
    time.sleep(float(seconds))
    return {"viewers": len(viewers)}


if __name__ == "__main__":
    url, what, *more = sys.argv[1:]
    print(json.dumps(globals()[what](url, *more)))
