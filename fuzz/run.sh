#!/usr/bin/env bash
# Runs every fuzz target for some seconds: fuzz/run.sh SECONDS [TARGET...]. Prints one line each: target, executions, result.
set -euo pipefail
cd "$(dirname "$0")"
seconds=${1:?usage: fuzz/run.sh SECONDS [TARGET...]}
shift
export RUSTC_BOOTSTRAP=1
if ! cargo fuzz --version >/dev/null 2>&1; then
  echo "error: cargo-fuzz is missing: cargo install --locked cargo-fuzz" >&2
  exit 2
fi
features=(${FEATURES:+--features "$FEATURES"})
# These crates are safe Rust: bounds checks and overflow checks find what a sanitizer would, and cost less.
options=(--fuzz-dir . --sanitizer none "${features[@]}")
targets=("$@")
if ((${#targets[@]} == 0)); then
  targets=(bag cdr compressed_image calibration parameter_file ros_arguments process_pipe)
  [[ ${FEATURES:-} == middleware ]] && targets=(zenoh dds_request)
fi
./corpus.sh
failed=0
for target in "${targets[@]}"; do
  log=$(mktemp)
  # 2 GB: memory out of proportion is a find, too.
  if cargo fuzz run "${options[@]}" "$target" -- -max_total_time="$seconds" -rss_limit_mb=2048 -print_final_stats=1 \
    -max_len=65536 2>"$log"; then
    result=ok
  else
    result=FAILED failed=1
    tail -30 "$log" >&2
  fi
  executions=$(grep -o 'stat::number_of_executed_units: *[0-9]*' "$log" | grep -o '[0-9]*$' || echo 0)
  printf '%s %s executions %s\n' "$target" "$executions" "$result"
  rm "$log"
done
for scratch in /dev/shm/fuzzed-*; do
  # Another run may use its own.
  [[ -e /proc/${scratch##*-} ]] || rm -rf "$scratch"
done
exit "$failed"
