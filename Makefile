# The commands of this repository. What each one does is in the script of its name in tools/.

# Address and data directory of `make serve`.
LISTEN ?= 127.0.0.1:8080
DATA ?= ./data
# Suite (all if empty) and output folder of `make bench`.
SUITE ?=
OUT ?= bench-out
# Repetitions of `make soak`.
REPEATS ?= 1000
# Seconds for each target of `make fuzz`.
SECONDS ?= 10

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help serve test check build bench soak fuzz web-types setup setup-test clean

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s%s\n", $$1, $$2 }' Makefile

serve: build ## set up, build and start on http://LISTEN (LISTEN=127.0.0.1:8080 DATA=./data)
	@tools/serve.sh "$(LISTEN)" "$(DATA)"

test: setup-test ## set up and run every test: Rust, web client, browser
	@tools/test.sh

check: setup ## form, lints, shaders, types, licences
	@tools/check.sh

build: setup ## the web client and target/release/tyndall
	@tools/build.sh

bench: build ## run time against error, edits, streaming (SUITE= OUT=bench-out)
	@target/release/tyndall bench $(SUITE) --out "$(OUT)"

soak: setup ## the Rust tests a thousandfold, for hours (REPEATS=1000)
	@tools/soak.sh "$(REPEATS)"

fuzz: setup ## files made by chance against every reader (SECONDS=10 for each)
	@tools/fuzz.sh "$(SECONDS)"

web-types: setup ## write the web client's types from proto
	@tools/web-types.sh

setup: ## install what building and serving need (Debian, Ubuntu)
	@tools/setup.sh serve

setup-test: ## the same, and Chromium
	@tools/setup.sh test

clean: ## remove everything built or downloaded; data stays
	@cargo clean
	@rm -rf target web/dist web/node_modules tests/e2e/node_modules tests/e2e/artifacts bench-out
