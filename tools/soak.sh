#!/usr/bin/env bash
# Usage: tools/soak.sh REPEATS
#
# The Rust tests again, at a size that takes hours: tests that repeat an edit or a request
# do so TYNDALL_SOAK times, property tests draw PROPTEST_CASES cases.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"
# shellcheck source=tools/vulkan.sh
. tools/vulkan.sh

# Cases of a property test for each repetition.
CASES_PER_REPEAT=10

TYNDALL_SOAK="${1:?how many repetitions}"
PROPTEST_CASES=$((TYNDALL_SOAK * CASES_PER_REPEAT))
TYNDALL_BIN="$PWD/target/release/tyndall"
export TYNDALL_SOAK PROPTEST_CASES TYNDALL_BIN

pin_software_driver
step "build" tools/build.sh
if [ -n "$FAILED_STEPS" ]; then finish soak; fi
step "Rust tests, $TYNDALL_SOAK repetitions" cargo test --release --workspace --no-fail-fast
finish soak
