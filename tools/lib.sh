# shellcheck shell=bash
# What the scripts beside this file share: where the repository is, how they talk, how a
# list of steps is run and summed up. Sourced, never run.
#
# Kept to what bash 3.2 understands, so that a system that is not supported still gets
# its explanation instead of a syntax error.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Notes that let a second run skip what is already done. `cargo clean` removes them too.
NOTES=target/tooling

# rustup puts cargo here; a shell that was open during its installation does not know yet.
PATH="$PATH:${CARGO_HOME:-${HOME:-/root}/.cargo}/bin"
export PATH

say() { printf '==> %s\n' "$*"; }

die() {
  printf 'tyndall: %s\n' "$*" >&2
  exit 1
}

have() { command -v "$1" >/dev/null 2>&1; }

# at_least VERSION MINIMUM: dotted numbers compared field by field.
at_least() { [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }

# build_program NAME: builds that program of the workspace, prints where it is.
#
# Always within the whole workspace and with one target that has dev-dependencies (the
# example), so that cargo settles on the same features of every crate as for
# `cargo test --workspace`. With the program alone a few low crates would differ in a
# feature, and wgpu and all that stands on it would be compiled a second time.
build_program() {
  local targets="--example web_types"
  if [ "$1" != web_types ]; then targets="$targets --bin $1"; fi
  # shellcheck disable=SC2086 # the list is meant to be split
  cargo build --release --workspace $targets --message-format=json-render-diagnostics |
    sed -n "s|.*\"executable\":\"\([^\"]*/$1\)\".*|\1|p" | tail -n 1
}

# Steps run one after the other, each to its end, so that one run shows everything that is
# wrong. `step NAME COMMAND...` notes the steps that failed; `finish TITLE` names them in
# its last line, leaves them in $NOTES/failed.TITLE for .ci/run, and exits 1.
FAILED_STEPS=""

step() {
  local name="$1" began=$SECONDS status=0
  shift
  say "$name"
  # Not as a condition: `set -e` would be off in everything the step calls.
  set +e
  (
    set -e
    "$@"
  )
  status=$?
  set -e
  if [ "$status" -eq 0 ]; then
    say "$name: ok ($((SECONDS - began)) s)"
  else
    say "$name: FAILED with status $status ($((SECONDS - began)) s)"
    FAILED_STEPS="${FAILED_STEPS:+$FAILED_STEPS, }$name"
  fi
}

finish() {
  mkdir -p "$NOTES"
  rm -f "$NOTES/failed.$1"
  if [ -n "$FAILED_STEPS" ]; then
    printf '%s\n' "$FAILED_STEPS" >"$NOTES/failed.$1"
    say "make $1 FAILED in: $FAILED_STEPS"
    exit 1
  fi
  say "make $1: all steps passed ($SECONDS s)"
}
