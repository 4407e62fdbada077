#!/usr/bin/env bash
# Usage: tools/node.sh install FOLDER   packages as locked, if the lock or Node changed
#        tools/node.sh build            the web client into web/dist, if its sources changed

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

# What an installation depends on: the locked packages, and Node with its architecture.
installation_key() { # FOLDER
  {
    node --print 'process.version + process.arch'
    cat "$1/package.json" "$1/package-lock.json"
  } | sha256sum | cut -d ' ' -f 1
}

install_packages() { # FOLDER
  # Inside the folder that `npm ci` deletes first: a broken installation leaves no note.
  local note="$1/node_modules/.installed" key
  if ! [ -f "$1/package-lock.json" ]; then die "$1/package-lock.json is missing"; fi
  key=$(installation_key "$1")
  if [ -f "$note" ] && [ "$(cat "$note")" = "$key" ]; then return; fi
  say "$1: installing its packages"
  npm --prefix "$1" ci --no-audit --no-fund --no-update-notifier
  mkdir -p "$1/node_modules" # absent if there was nothing to install
  printf '%s\n' "$key" >"$note"
}

# What the built client depends on: every file of web/ but what is installed or built.
web_key() {
  {
    installation_key web
    find web \( -name node_modules -o -path web/dist \) -prune -o -type f -print0 |
      LC_ALL=C sort -z | xargs -0 sha256sum
  } | sha256sum | cut -d ' ' -f 1
}

build_web() {
  local note="$NOTES/web-built" key
  install_packages web
  key=$(web_key)
  # An unchanged client is left alone, or cargo would see new files and link the server anew.
  if [ -f web/dist/index.html ] && [ -f "$note" ] && [ "$(cat "$note")" = "$key" ]; then return; fi
  say "web: building the client"
  rm -f "$note"
  npm --prefix web run --silent build
  mkdir -p "$NOTES"
  web_key >"$note"
}

case "${1:-}" in
  install) install_packages "${2:?which folder}" ;;
  build) build_web ;;
  *) die "usage: tools/node.sh install FOLDER | build" ;;
esac
