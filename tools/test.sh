#!/usr/bin/env bash
# Usage: tools/test.sh
#
# Every test: Rust, web client, and a real browser against the release binary.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"
# shellcheck source=tools/vulkan.sh
. tools/vulkan.sh
# shellcheck source=tools/browser.sh
. tools/browser.sh

# For each of a dozen targets: the same look beyond the seeds every time, and its bound.
FUZZ_SECONDS=20
# A browser that hangs must not hold the machine for ever.
BROWSER_TESTS_SECONDS=900

web_unit_tests() {
  tools/node.sh install web
  npm --prefix web test
}

browser_tests() {
  tools/node.sh install tests/e2e
  timeout --foreground --kill-after=20 "$BROWSER_TESTS_SECONDS" npm --prefix tests/e2e test
}

pin_software_driver
CHROMIUM=$(find_chromium) || die "no Chromium found; 'make test' installs it"
TYNDALL_BIN="$PWD/target/release/tyndall"
export CHROMIUM TYNDALL_BIN
say "browser: $CHROMIUM"

step "build" tools/build.sh
if [ -n "$FAILED_STEPS" ]; then finish test; fi # or an older binary would be tested
step "Rust tests" cargo test --release --workspace --no-fail-fast
step "fuzzing of the readers" tools/fuzz.sh --same "$FUZZ_SECONDS"
step "web client: unit tests" web_unit_tests
step "browser tests" browser_tests
finish test
