#!/usr/bin/env bash
# The live node between a camera and a reader that are not ours, under load; prints what each of the three says.
#
#   tests/peers/load.sh zenoh|cyclone|fastdds WIDTH HEIGHT HZ SECONDS [--pattern] [--reliable] [--beside]
#
# --pattern sends images that are bright all over, the most work there is, instead of a stripe in the dark. On DDS,
# --reliable makes camera and node reliable, and --beside has a subscriber of the camera's vendor count the images, too.
# Needs `cargo build --release` and, for the peers, one run of `cargo test --test it` before.
set -euo pipefail
cd "$(dirname "$0")/../.."
peer=$1 width=$2 height=$3 hz=$4 seconds=$5
shift 5
stripe=(--stripe) reliable=() qos=() is_beside=
for option in "$@"; do
  case $option in
    --pattern) stripe=() ;;
    --reliable) reliable=(--reliable) qos=(--ros-args -p qos_overrides./image_raw.subscription.reliability:=reliable) ;;
    --beside) is_beside=1 ;;
    *) echo "no option $option" >&2; exit 2 ;;
  esac
done
target=${CARGO_TARGET_DIR:-target}
node=$target/release/laser_profiler
if [ "$peer" = zenoh ] && [ -n "${reliable[*]}$is_beside" ]; then
  echo "--reliable and --beside need a camera on DDS" >&2
  exit 2
fi
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
    peer publish --topic rt/image_raw --width "$width" --height "$height" --rate "$hz" --count $((hz * seconds)) \
      "${stripe[@]}" "${reliable[@]}"
  }
  read_images() {
    peer subscribe --topic rt/image_raw "${reliable[@]}" --count 1000000 --seconds $((seconds + 8))
  }
  "$node" run --transport dds --json "${qos[@]}" >"$out/node" &
fi
process=$!
trap 'kill -9 $process 2>/dev/null || true; rm -rf "$out"' EXIT
sleep 3 # A person looks at the result: what comes before everybody has met is seen in it.
read_results >"$out/reader" &
reader=$!
[ -z "$is_beside" ] || read_images >"$out/beside" &
beside=$!
sleep 2
send_images | tee "$out/camera"
# The node and its middleware process.
family="$process $(cat /proc/"$process"/task/*/children)"
memory=$(for one in $family; do grep VmHWM "/proc/$one/status"; done | awk '{sum += $2} END {print sum / 1024 " MB"}')
processor=$(for one in $family; do cat "/proc/$one/stat"; done | awk '{sum += ($14 + $15) / 100} END {print sum}')
wait $reader $beside
kill $process
wait $process || true
[ -z "$is_beside" ] || sed 's/^/the subscriber beside the node: /' "$out/beside"
cat "$out/reader" "$out/node"
echo "peak memory of both processes $memory, processor $processor s"
uptime
