#!/usr/bin/env bash
# The live node between a camera and a reader that are not ours, under load; prints what each of the three says.
#
#   tests/peers/load.sh zenoh|cyclone|fastdds WIDTH HEIGHT HZ SECONDS [--pattern]
#
# --pattern sends images that are bright all over, the most work there is, instead of a stripe in the dark.
# Needs `cargo build --release` and, for the peers, one run of `cargo test --test it` before.
set -euo pipefail
cd "$(dirname "$0")/../.."
peer=$1 width=$2 height=$3 hz=$4 seconds=$5
stripe=(--stripe)
[ "${6:-}" = --pattern ] && stripe=()
target=${CARGO_TARGET_DIR:-target}
node=$target/release/laser_profiler
out=$(mktemp -d)
export ROS_DOMAIN_ID=$((RANDOM % 90 + 5))

if [ "$peer" = zenoh ]; then
  python=$target/tmp/interop-venv/bin/python
  at=tcp/127.0.0.1:17447
  hash=$(grep -A2 '"laser_profiler_msgs/msg/Centerline"' src/msg/laser_profiler_msgs.rs | grep -o 'RIHS01_[0-9a-f]*')
  peer() { "$python" tests/peers/zenoh_images.py "$@" --connect "$at" --domain "$ROS_DOMAIN_ID" </dev/null; }
  read_results() {
    peer receive --topic /laser_profiler/centerline --type laser_profiler_msgs/msg/Centerline --hash "$hash" \
      --seconds $((seconds + 20)) --idle 4
  }
  send_images() {
    peer send --width "$width" --height "$height" --fps "$hz" --seconds "$seconds" --linger 3 "${stripe[@]}"
  }
  export ZENOH_CONFIG_OVERRIDE="listen/endpoints=[\"$at\"]"
  "$node" run --transport zenoh --router --json >"$out/node" &
else
  peer() { "$target/tmp/$peer.peer" "$@" --domain "$ROS_DOMAIN_ID"; }
  read_results() {
    peer subscribe --topic rt/laser_profiler/centerline --type laser_profiler_msgs::msg::dds_::Centerline_ --reliable \
      --count 1000000 --seconds $((seconds + 8))
  }
  send_images() {
    peer publish --topic rt/image_raw --width "$width" --height "$height" --rate "$hz" --count $((hz * seconds)) "${stripe[@]}"
  }
  "$node" run --transport dds --json >"$out/node" &
fi
process=$!
trap 'kill -9 $process 2>/dev/null || true; rm -rf "$out"' EXIT
sleep 3 # A person looks at the result: what comes before everybody has met is seen in it.
read_results >"$out/reader" &
reader=$!
sleep 2
send_images | tee "$out/camera"
memory=$(grep VmHWM "/proc/$process/status")
processor=$(awk '{print ($14 + $15) / 100}' "/proc/$process/stat")
wait $reader
kill $process
wait $process || true
cat "$out/reader" "$out/node"
echo "peak memory ${memory#*:}, processor $processor s"
uptime
