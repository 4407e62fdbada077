#!/usr/bin/env bash
# Usage: tools/cargo-deny.sh
#
# Checks the dependencies against deny.toml: bans, licences, sources; known vulnerabilities
# where their database can be reached. Builds cargo-deny once, into target/tools.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

VERSION=0.20.2
ADVISORIES=https://github.com/rustsec/advisory-db
# Seconds after which the database counts as out of reach.
REACH_SECONDS=20

deny=target/tools/bin/cargo-deny
if [ "$(cargo-deny --version 2>/dev/null)" = "cargo-deny $VERSION" ]; then
  deny=cargo-deny
elif [ "$("$deny" --version 2>/dev/null)" != "cargo-deny $VERSION" ]; then
  say "building cargo-deny $VERSION into target/tools"
  # It runs for a second: built for a short build, not for speed.
  CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_OPT_LEVEL=0 \
    CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 \
    cargo install --locked --quiet --root target/tools --target-dir target/tools/build \
    "cargo-deny@$VERSION"
  rm -rf target/tools/build
fi

"$deny" --locked --workspace check --hide-inclusion-graph bans licenses sources
if GIT_TERMINAL_PROMPT=0 timeout "$REACH_SECONDS" \
  git ls-remote --quiet "$ADVISORIES" HEAD >/dev/null 2>&1; then
  "$deny" --locked --workspace check advisories
else
  say "left out: known vulnerabilities ($ADVISORIES cannot be reached)"
fi
