#!/usr/bin/env bash
# Usage: tools/serve.sh LISTEN DATA
#
# Starts the built server in the foreground.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"
# shellcheck source=tools/vulkan.sh
. tools/vulkan.sh

listen="${1:?address to listen on}" data="${2:?data directory}"
address=$listen
case "$listen" in
  0.0.0.0:*) address="127.0.0.1:${listen##*:}" ;;
  '[::]:'*) address="[::1]:${listen##*:}" ;;
esac
say "starting Tyndall on http://$address (data in $data; stop with Ctrl-C)"
# Without a GPU, Mesa's device selection layer has nothing to select, but complains of no desktop.
if ! vulkan_driver_chosen && ! gpu_driver; then export NODEVICE_SELECT=1; fi
exec target/release/tyndall serve --listen "$listen" --data "$data"
