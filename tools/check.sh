#!/usr/bin/env bash
# Usage: tools/check.sh
#
# Everything that can be judged without running the product: form, lints, shaders, types,
# dependencies.

# shellcheck source=tools/lib.sh
. "$(dirname "$0")/lib.sh"

# The fuzz targets are a workspace of their own.
FUZZ=server/formats/fuzz/Cargo.toml

lock_files() {
  cargo metadata --locked --format-version 1 --quiet >/dev/null
  cargo metadata --locked --format-version 1 --quiet --manifest-path "$FUZZ" >/dev/null
}

rust_format() {
  cargo fmt --all --check
  cargo fmt --check --manifest-path "$FUZZ"
}

web_client() {
  tools/node.sh install web
  npm --prefix web run --silent check
}

browser_tests() {
  tools/node.sh install tests/e2e
  npm --prefix tests/e2e run --silent --if-present check
}

shell_scripts() {
  if have shellcheck; then
    shellcheck --external-sources tools/*.sh docker/*.sh .ci/run
  else
    say "left out: shellcheck is not installed"
  fi
}

step "Cargo.lock is current" lock_files
step "rustfmt" rust_format
step "shell scripts" shell_scripts
step "web client: types and lint" web_client
# Before clippy: the server's crate takes the built client in.
step "web client: build" tools/node.sh build
step "browser tests: types and lint" browser_tests
step "clippy" cargo clippy --release --workspace --all-targets --keep-going -- -D warnings
# Chosen by target within the whole workspace, to share what `make test` compiles.
step "shaders are valid, web types are current" \
  cargo test --release --workspace --test shaders --test web_types
step "dependencies" tools/cargo-deny.sh
finish check
