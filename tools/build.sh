#!/usr/bin/env bash
# Usage: tools/build.sh
#
# The web client, then the server with the client inside: target/release/tyndall.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

BINARY=target/release/tyndall

tools/node.sh build
say "building $BINARY"
built=$(build_program tyndall)
if [ -z "$built" ]; then die "cargo built no tyndall"; fi
# Cargo may be told to build elsewhere (CARGO_TARGET_DIR); the binary's place stays the same.
if ! [ "$built" -ef "$BINARY" ]; then
  mkdir -p "$(dirname "$BINARY")"
  cp -p "$built" "$BINARY.new"
  mv "$BINARY.new" "$BINARY"
fi
