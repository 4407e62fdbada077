#!/usr/bin/env bash
# Usage: tools/setup.sh serve|test
#
# Finds out what this machine lacks to build and serve Tyndall (`test`: and to run the
# browser tests). On Debian and Ubuntu it installs that; on any other system it says what
# to install and stops. Touches nothing, and no network, when nothing is missing.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"
# shellcheck source=tools/vulkan.sh
. tools/vulkan.sh
# shellcheck source=tools/browser.sh
. tools/browser.sh

MIN_RUST=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
# The oldest Node that both Vite 6 and ESLint 9 accept, and the one of Debian 12.
MIN_NODE=18.18
# Seconds to wait while another process installs packages.
APT_LOCK_SECONDS=300

LEVEL="${1:-}"
case "$LEVEL" in serve | test) ;; *) die "usage: tools/setup.sh serve|test" ;; esac

# --- What is missing -------------------------------------------------------------------

MISSING=""  # one line each: what | what for | Debian packages | Fedora | Arch Linux

missing() { MISSING="$MISSING$1|$2|$3|$4|$5"$'\n'; }

vulkan_loader() {
  local folder
  if have ldconfig && ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1'; then return 0; fi
  # ldconfig may be out of an ordinary user's path.
  for folder in /usr/lib /usr/lib64 /usr/local/lib "/usr/lib/$(uname -m)-linux-gnu"; do
    if [ -e "$folder/libvulkan.so.1" ]; then return 0; fi
  done
  return 1
}

node_version() { node --version 2>/dev/null | sed 's/^v//'; }

node_is_new_enough() { have node && at_least "$(node_version)" "$MIN_NODE"; }

nasm_is_useful() { case "$(uname -m)" in x86_64 | i?86) true ;; *) false ;; esac; }

find_missing() {
  MISSING=""
  if ! have cc || ! have c++; then
    missing "a C and C++ compiler" "links the server, builds its JPEG encoder" \
      "gcc g++ libc6-dev" "gcc gcc-c++ glibc-devel" "gcc"
  fi
  if ! have make; then missing "make" "builds the JPEG encoder" make make make; fi
  if ! have cmake; then missing "cmake" "builds the JPEG encoder" cmake cmake cmake; fi
  if nasm_is_useful && ! have nasm; then
    missing "nasm" "the JPEG encoder's vector code" nasm nasm nasm
  fi
  if ! vulkan_loader; then
    missing "the Vulkan loader (libvulkan.so.1)" "finds the GPU" \
      libvulkan1 vulkan-loader vulkan-icd-loader
  fi
  if ! vulkan_driver_chosen && ! gpu_driver && [ -z "$(software_manifest)" ]; then
    missing "a Vulkan driver" "draws; without a GPU in software (Mesa lavapipe)" \
      mesa-vulkan-drivers mesa-vulkan-drivers vulkan-swrast
  fi
  if ! node_is_new_enough; then
    missing "Node $MIN_NODE or newer$(have node && printf ' (%s is %s)' "$(command -v node)" "$(node_version)")" "builds the web client" nodejs nodejs nodejs
  fi
  if ! have npm; then missing "npm" "builds the web client" npm nodejs-npm npm; fi
  if [ "$LEVEL" = test ] && ! find_chromium >/dev/null; then
    missing "Chromium" "runs the browser tests" chromium chromium chromium
  fi
}

# packages COLUMN: that column of $MISSING, on one line.
packages() {
  printf '%s' "$MISSING" | cut -d '|' -f "$1" | tr '\n' ' ' | sed 's/ *$//'
}

# --- What system this is ---------------------------------------------------------------

# os FIELD: one field of the system's own description, empty if there is none.
os() {
  if [ -r /etc/os-release ]; then
    sed -n "s/^$1=//p" /etc/os-release | tr -d "\"'" | head -n 1
  fi
}

debian_like() {
  case " $(os ID) $(os ID_LIKE) " in *" debian "* | *" ubuntu "*) have apt-get ;; *) false ;; esac
}

system_name() {
  local name
  name=$(os PRETTY_NAME)
  printf '%s' "${name:-$(uname -s)}"
}

# --- Telling what to install -----------------------------------------------------------

check_rust() {
  local rust
  if ! have cargo || ! have rustc; then
    die "Rust $MIN_RUST or newer is missing. Install it from https://rustup.rs and run this again."
  fi
  rust=$(rustc --version | cut -d ' ' -f 2)
  if ! at_least "${rust%%-*}" "$MIN_RUST"; then
    die "Rust $rust is too old, Tyndall needs $MIN_RUST or newer. Run 'rustup update stable'," \
      "or install Rust from https://rustup.rs, and run this again."
  fi
}

explain_other_system() {
  {
    printf 'tyndall: this system is %s. Only Debian and Ubuntu are set up automatically.\n' \
      "$(system_name)"
    printf 'Please install the following, then run the same command again:\n'
    printf '%s' "$MISSING" | while IFS='|' read -r what purpose _; do
      printf '  - %s: %s\n' "$what" "$purpose"
    done
    case " $(os ID) $(os ID_LIKE) " in
      *" fedora "*) printf 'That is: sudo dnf install %s\n' "$(packages 4)" ;;
      *" arch "*) printf 'That is: sudo pacman -S --needed %s\n' "$(packages 5)" ;;
    esac
    if [ "$(uname -s)" != Linux ]; then
      printf 'Tyndall needs Vulkan and is tested on Linux alone.\n'
    fi
  } >&2
  exit 1
}

# --- Installing on Debian and Ubuntu ---------------------------------------------------

as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif [ -t 0 ]; then
    sudo "$@"
  else
    sudo -n "$@" # without a terminal nobody could type a password
  fi
}

explain_no_root() {
  die "installing packages needs root. Run this, then the same command again:" \
    "apt-get update && apt-get install -y --no-install-recommends $(packages 3)"
}

check_can_be_root() {
  if [ "$(id -u)" -eq 0 ]; then return; fi
  if ! have sudo; then explain_no_root; fi
  if ! [ -t 0 ] && ! sudo -n true 2>/dev/null; then explain_no_root; fi
}

# Ubuntu's chromium packages hold no browser, they only call for the snap.
check_chromium_package() {
  case " $(packages 3) " in *" chromium "*) ;; *) return 0 ;; esac
  if [ "$(os ID)" = ubuntu ]; then
    die "the browser tests need Chromium, and Ubuntu has it as a snap only. Run" \
      "'sudo snap install chromium' or install Google Chrome (https://www.google.com/chrome)," \
      "then run this again. For a browser elsewhere set CHROMIUM=/path/to/chrome." \
      "Everything except 'make test' works without it."
  fi
}

check_node_package() {
  local candidate
  case " $(packages 3) " in *" nodejs "*) ;; *) return 0 ;; esac
  candidate=$(LC_ALL=C apt-cache policy nodejs | sed -n 's/^  Candidate: //p')
  if [ -z "$candidate" ] || [ "$candidate" = "(none)" ] ||
    ! dpkg --compare-versions "$candidate" ge "$MIN_NODE"; then
    die "$(system_name) offers Node ${candidate:-none}, Tyndall needs $MIN_NODE or newer." \
      "Install it from https://nodejs.org/en/download and run this again."
  fi
}

apt() {
  as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get -q -o "DPkg::Lock::Timeout=$APT_LOCK_SECONDS" "$@"
}

install_with_apt() {
  local log="$NOTES/apt.log"
  check_chromium_package
  check_can_be_root
  mkdir -p "$NOTES"
  say "refreshing the package lists (log: $log)"
  apt update >"$log" 2>&1 ||
    say "not every package source could be refreshed; going on with what there is"
  check_node_package
  say "installing $(packages 3) (minutes; log: $log)"
  # shellcheck disable=SC2046 # the list is meant to be split
  if ! apt install -y --no-install-recommends $(packages 3) >>"$log" 2>&1; then
    tail -n 20 "$log" >&2
    die "apt-get could not install: $(packages 3)"
  fi
}

# --- Set up ----------------------------------------------------------------------------

find_missing
if [ -n "$MISSING" ] && ! debian_like; then
  if ! have cargo; then
    missing "Rust $MIN_RUST or newer (https://rustup.rs)" "builds the server" "" "" ""
  fi
  explain_other_system
fi
check_rust
if nvidia_device && [ -z "$(vulkan_manifests '*nvidia*.json')" ] && ! vulkan_driver_chosen; then
  say "note: an NVIDIA device is here, but not the Vulkan part of its driver (on Debian" \
    "nvidia-vulkan-icd, on Ubuntu libnvidia-gl-<version>; in a container" \
    "NVIDIA_DRIVER_CAPABILITIES must hold 'graphics'). Until it is, Tyndall draws in software."
fi
if [ -z "$MISSING" ]; then
  say "set-up: nothing is missing"
else
  install_with_apt
  find_missing
  if [ -n "$MISSING" ]; then
    die "still missing after the installation: $(printf '%s' "$MISSING" | cut -d '|' -f 1 | paste -sd ';' -)"
  fi
  say "set-up: done"
fi
