#!/usr/bin/env bash
# Usage: tools/web-types.sh
#
# Writes the web client's types from the crate `proto`.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

program=$(build_program web_types)
"$program"
