#!/usr/bin/env bash
# Lays out a directory in which ros2 run, ros2 launch and ros2 interface find the node and its messages, without colcon.
#
#   packaging/install_prefix.sh PREFIX [--binary FILE]
#
# Without --binary, cargo builds the executable with Cyclone DDS, which needs cmake and libclang. The directory can be
# moved and copied to other machines. There:
#   source PREFIX/setup.bash && ros2 launch laser_profiler single_camera.launch.py
#
# The messages are definitions only: who subscribes to laser_profiler_msgs from C++ or Python builds msgs/laser_profiler_msgs
# with colcon, and sources that workspace after this prefix.
set -euo pipefail

fail() {
  echo "error: $1" >&2
  exit "${2:-1}"
}
usage() { fail "usage: install_prefix.sh PREFIX [--binary FILE]" 2; }

prefix="" binary=""
while (($#)); do
  case "$1" in
    --binary) (($# > 1)) || usage; binary=$2; shift 2 ;;
    -*) usage ;;
    *) [[ -z $prefix ]] || usage; prefix=$1; shift ;;
  esac
done
[[ -n $prefix ]] || usage

repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
if [[ -e $prefix ]] && { [[ ! -d $prefix ]] || [[ -n $(ls -A "$prefix") ]]; }; then
  fail "$prefix is there and not an empty directory: name another, or remove it"
fi
if [[ -z $binary ]]; then
  target="${CARGO_TARGET_DIR:-$repository/target}"
  # In the repository, where rust-toolchain.toml is seen.
  (cd "$repository" && cargo build --release --locked --features cyclone --bin laser_profiler --target-dir "$target")
  binary="$target/release/laser_profiler"
fi
[[ -f $binary ]] || fail "no executable $binary: name it by --binary"

put() { # MODE DIRECTORY FILE...
  local mode=$1 directory=$2
  shift 2
  install -d "$prefix/$directory"
  install -m "$mode" "$@" "$prefix/$directory/"
}
mark() { # RESOURCE PACKAGE < CONTENT
  install -d "$prefix/share/ament_index/resource_index/$1"
  cat > "$prefix/share/ament_index/resource_index/$1/$2"
}

install -d "$prefix/lib/laser_profiler"
install -m 755 "$binary" "$prefix/lib/laser_profiler/laser_profiler"
put 644 share/laser_profiler "$repository/packaging/laser_profiler/package.xml"
put 644 share/laser_profiler/launch "$repository"/launch_configs/*.launch.*
put 644 share/laser_profiler/viewers "$repository"/launch_configs/viewers/*.{json,py}
for file in "$repository"/launch_configs/*.yaml; do
  [[ $file == *.launch.yaml ]] || put 644 share/laser_profiler/config "$file"
done
mark packages laser_profiler </dev/null

messages="$repository/msgs/laser_profiler_msgs"
put 644 share/laser_profiler_msgs "$messages/package.xml"
for kind in msg srv action; do
  put 644 "share/laser_profiler_msgs/$kind" "$messages/$kind"/*."$kind"
done
mark packages laser_profiler_msgs </dev/null
(cd "$messages" && printf '%s\n' action/*.action msg/*.msg srv/*.srv) | mark rosidl_interfaces laser_profiler_msgs

# This prefix stands on no other: setup.* and local_setup.* do the same.
put 644 . "$repository"/packaging/prefix/*
for shell in bash zsh; do
  install -m 644 "$prefix/local_setup.$shell" "$prefix/setup.$shell"
done
