#!/usr/bin/env bash
# Usage: tools/fuzz.sh [--same] [SECONDS [TARGET...]]
#
# Runs the fuzz targets of the readers (server/formats/fuzz; all if none is named), each for
# that long (10 s). They start from the seeds and from what earlier runs found. Builds them as
# `cargo fuzz run -s none` does, but needs neither cargo-fuzz nor a nightly toolchain.
#
# --same: the same cases every time (from the seeds alone, SAME_RUNS of them), for a test suite
# that is to answer the same for the same code. SECONDS is then only a bound.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

SAME=
if [ "${1:-}" = --same ]; then
  SAME=1
  shift
fi
PER_TARGET="${1:-10}"
shift || true
case "$PER_TARGET" in
'' | *[!0-9]*) die "tools/fuzz.sh [--same] [SECONDS [TARGET...]]: SECONDS is a whole number" ;;
esac

FUZZ=server/formats/fuzz
BUILD="${CARGO_TARGET_DIR:-target}/fuzz"
# Memory of a reader at its limits is far below these; memory that is reserved without being
# touched counts in the second one only.
MAX_RESIDENT_MIB=1024
MAX_RESERVED_KIB=$((2 << 20))
# Longest time of one case.
MAX_CASE_SECONDS=10
# Cases of each target with --same, and where chance starts.
SAME_RUNS=10000
SAME_SEED=1
# Largest input, bytes. Seeds are half of that at most.
MAX_INPUT_BYTES=4096

host=$(rustc -vV | sed -n 's/^host: //p')
say "building the fuzz targets"
# Given a target, cargo leaves what runs during the build without instruments.
RUSTFLAGS="-Cpasses=sancov-module \
-Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares \
--cfg fuzzing" \
  cargo build --release --locked --quiet \
  --manifest-path "$FUZZ/Cargo.toml" --target "$host" --target-dir "$BUILD"

# Readers take paths: each case is written to a file, in memory where that is possible.
in_memory=/dev/shm
if ! [ -w "$in_memory" ]; then in_memory="$BUILD"; fi
TMPDIR=$(mktemp -d -p "$in_memory")
trap 'rm -rf "$TMPDIR"' EXIT
# One thread: a case takes microseconds.
RAYON_NUM_THREADS=1
export TMPDIR RAYON_NUM_THREADS

fuzz() {
  local corpus="$BUILD/corpus/$1" artifacts="$BUILD/artifacts/$1" log="$BUILD/$1.log" same=()
  if [ -n "$SAME" ]; then
    corpus="$TMPDIR/corpus-$1"
    same=("-seed=$SAME_SEED" "-runs=$SAME_RUNS")
  fi
  mkdir -p "$corpus" "$artifacts"
  if ! (
    ulimit -v "$MAX_RESERVED_KIB"
    exec "$BUILD/$host/release/$1" -max_total_time="$PER_TARGET" -rss_limit_mb="$MAX_RESIDENT_MIB" \
      -timeout="$MAX_CASE_SECONDS" -max_len="$MAX_INPUT_BYTES" -print_final_stats=1 \
      -artifact_prefix="$artifacts/" "${same[@]}" "$corpus" "$FUZZ/seeds/$1"
  ) >"$log" 2>&1; then
    tail -n 60 "$log"
    say "$1: to see it again: $BUILD/$host/release/$1 FILE"
    return 1
  fi
  grep -E 'DONE|Done' "$log"
}

if [ $# -eq 0 ]; then
  for file in "$FUZZ"/fuzz_targets/*.rs; do
    set -- "$@" "$(basename "$file" .rs)"
  done
fi
for target in "$@"; do
  step "fuzz $target" fuzz "$target"
done
finish fuzz
