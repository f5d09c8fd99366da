#!/usr/bin/env bash
# Puts small real inputs of every kind into the corpora, unless they are there.
set -euo pipefail
cd "$(dirname "$0")"
seed() { # TARGET FILE...
  mkdir -p "corpus/$1"
  local target=$1
  shift
  for file in "$@"; do cp -n "$file" "corpus/$target/seed_$(basename "$file")"; done
}
seed parameter_file ../launch_configs/*.yaml ../bags/*.params.yaml
seed calibration ../launch_configs/*calibration*.yaml ../bags/*/calibration.yaml
seed ros_arguments seeds/ros_arguments/*
for file in ../tests/data/cdr/*; do
  # The first byte selects the type.
  mkdir -p corpus/cdr
  for selector in 0 1 2 3 4 5; do
    out=corpus/cdr/seed_${selector}_$(basename "$file")
    [[ -e $out ]] || { printf "\\x0$selector"; cat "$file"; } >"$out"
  done
done
# The head and the tail of a recording hold every kind of record.
mkdir -p corpus/bag
for file in ../bags/*/*.mcap; do
  name=corpus/bag/seed_$(basename "$file")
  [[ -e $name ]] || { head -c 20000 "$file"; tail -c 8000 "$file"; } >"$name"
done
mkdir -p corpus/compressed_image
for file in ../docs/*.png; do
  name=corpus/compressed_image/seed_$(basename "$file")
  [[ -e $name ]] || head -c 60000 "$file" >"$name"
done
