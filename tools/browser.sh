# shellcheck shell=bash
# Which browser the browser tests use. Sourced, never run.

# Prints the path of a Chromium that starts: $CHROMIUM if set, else the first that is found.
# Starting it matters, because Ubuntu's /usr/bin/chromium-browser may be a stub that only
# asks for the snap.
find_chromium() {
  local name path
  for name in ${CHROMIUM:-chromium chromium-browser google-chrome google-chrome-stable}; do
    path=$(command -v "$name" || true)
    if [ -n "$path" ] && timeout 30 "$path" --version >/dev/null 2>&1; then
      printf '%s' "$path"
      return 0
    fi
  done
  return 1
}
