#!/usr/bin/env bash
# Usage: docker/prove.sh [BINARY]
#
# Proves the recipe of the `software` image without a container engine: performs the Dockerfile's
# own steps of its runtime stages in an empty Debian root, with the compiled binary (default
# target/release/tyndall) in the place of the build stages' result, starts the service there as the
# image's user, and runs the image's health check. Needs root, debootstrap and a Debian mirror.

set -euo pipefail
cd "$(dirname "$0")/.."

binary=${1:-target/release/tyndall}
recipe=docker/Dockerfile
wait_seconds=60

say() { printf '==> %s\n' "$*"; }
die() { printf 'prove.sh: %s\n' "$*" >&2; exit 1; }

[ "$(id -u)" = 0 ] || die "must be root, to make a Debian root and to start the service as another user"
command -v debootstrap >/dev/null || die "debootstrap is missing (apt-get install debootstrap)"
[ -x "$binary" ] || die "$binary is missing (make build)"

root=$(mktemp -d)
chmod 755 "$root"
service=""
cleanup() {
  if [ -n "$service" ]; then kill "$service" 2>/dev/null || true; fi
  umount "$root/proc" "$root/dev" 2>/dev/null || true
  rm -rf --one-file-system "$root"
}
trap cleanup EXIT

# Instructions of a stage, one a line, continuation lines joined, comments dropped.
stage() {
  awk -v wanted="$1" '
    /^[[:space:]]*#/ { next }
    { line = line $0 }
    /\\$/ { sub(/\\$/, " ", line); next }
    { if (line ~ /^FROM /) { inside = line ~ " AS " wanted "$" }
      else if (inside && line ~ /[^[:space:]]/) { print line }
      line = "" }' "$recipe"
}

# The words of a JSON array of plain strings.
words() { printf '%s' "$1" | sed 's/^\[ *"//; s/" *\]$//; s/" *, *"/\n/g'; }

inside() { chroot "$root" /usr/bin/env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive "$@"; }

suite=$(sed -n 's/^FROM debian:\([a-z]*\)-slim AS runtime$/\1/p' "$recipe")
[ -n "$suite" ] || die "the runtime stage of $recipe does not start from a Debian image"
say "an empty Debian $suite"
debootstrap --variant=minbase "$suite" "$root" >"$root.log" 2>&1 || { tail -5 "$root.log" >&2; die "debootstrap failed"; }
rm -f "$root.log"
# What a container engine brings along: name resolution, /proc, /dev.
cp -L /etc/resolv.conf "$root/etc/resolv.conf"
for file in /etc/apt/apt.conf.d/*; do
  if grep -qs -i proxy "$file"; then cp "$file" "$root/etc/apt/apt.conf.d/"; fi
done
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"

user=root entry="" command="" health=""
environment=()
while IFS= read -r line; do
  say "$line"
  case "$line" in
    "RUN "*) inside sh -c "${line#RUN }" >/dev/null 2>"$root/step.log" || { tail -5 "$root/step.log" >&2; die "the step failed"; } ;;
    "COPY --from=server "*)
      read -r _ _ _ to <<<"$line"
      install -D "$binary" "$root$to" ;;
    "ENV "*) for pair in ${line#ENV }; do environment+=("$pair"); done ;;
    "VOLUME "*) mkdir -p "$root${line#VOLUME }" ;;
    "USER "*) user=${line#USER } ;;
    "ENTRYPOINT "*) entry=$(words "${line#ENTRYPOINT }") ;;
    "CMD "*) command=$(words "${line#CMD }") ;;
    "HEALTHCHECK "*) health=$(words "${line##*CMD }") ;;
    "EXPOSE "*) ;;
    *) die "do not know how to perform: $line" ;;
  esac
done < <(stage runtime; stage software)

as_user=(chroot "--userspec=$user:$user" "$root" /usr/bin/env -i PATH=/usr/local/bin:/usr/bin:/bin "${environment[@]}")
mapfile -t start < <(printf '%s\n%s\n' "$entry" "$command")
mapfile -t check < <(printf '%s\n' "$health")
[ "$user" != root ] || die "the image runs as root"

say "as $user: ${start[*]}"
"${as_user[@]}" "${start[@]}" &
service=$!
for _ in $(seq "$wait_seconds"); do
  if "${as_user[@]}" "${check[@]}" 2>/dev/null; then
    say "healthy"
    "${as_user[@]}" tyndall doctor | sed -n 1,5p
    exit 0
  fi
  kill -0 "$service" 2>/dev/null || die "the service ended"
  sleep 1
done
"${as_user[@]}" "${check[@]}" || die "not healthy after $wait_seconds seconds"
