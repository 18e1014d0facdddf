# What README and .ci/run call. Everything is installed into .venv and built into target.

PYTHON ?= python3
BIN := .venv/bin
FIGURES ?= figures
PACKAGING := .venv/packaging/bin
TRIED := target/sdist-tried
CRATES := $${CARGO_HOME:-$$HOME/.cargo}/registry/src/*
MANYLINUX := $(if $(filter Linux,$(shell uname)),--zig --compatibility manylinux2014)
FUZZED := $(basename $(notdir $(wildcard fuzz/fuzz_targets/*.rs)))
RUST := $(shell find rust -name '*.rs' -o -name 'Cargo.toml')

.PHONY: demo trial test test-rust test-python test-arm lint format docs docs-look bench bench-compare rivals validate soak fuzz fuzz-texts fuzz-guided fuzz-core valgrind deny counts wheel sdist try-sdist test-wheel licences clean

## Builds, installs into .venv and reproduces the report's figures.
demo: .venv/demo
	$(BIN)/modfun reproduce report --out $(FIGURES)

## Every test, Rust and Python.
test: test-rust test-python

test-rust:
	cargo test --release -p modfun

test-python: .venv/dev
	$(BIN)/python -m pytest -q -n 2 --dist worksteal

## The core compiled for 64-bit Arm and run under emulation: its bits beside this machine's, its instructions, the
## wheel. What it needs of Debian, it says.
test-arm: .venv/dev .venv/packaging/created
	$(PACKAGING)/python packaging/arm.py

## Formatting, clippy, ruff, types; the stub is the compiled core.
lint: .venv/dev
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mypy examples packaging
	$(BIN)/stubtest modfun._core

format: .venv/dev
	cargo fmt --all
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

## The documentation site into target/docs; a warning is an error.
docs: .venv/docs
	rm -rf docs/reference/generated
	$(BIN)/sphinx-build -E -W --keep-going -n -q -d target/doctrees docs target/docs

## What is too wide, cut off or in error on the built pages, in headless Chromium; screenshots into target/look.
docs-look: docs
	$(BIN)/python docs/look.py

## modfun against its rivals into docs/benchmarks.md; stages, growth of costs, what users wait for and the history
## of times into docs/performance.md.
bench: .venv/bench
	$(BIN)/python benches/compare/bench.py
	$(BIN)/python benches/compare/stages.py
	$(BIN)/python benches/compare/growth.py
	$(BIN)/python benches/compare/joint_growth.py
	$(BIN)/python benches/compare/waits.py
	$(BIN)/python benches/compare/history.py

## The programs of benches/programs.rs as they are beside BASE=commit, in turn: times and ratios.
bench-compare: .venv/created
	$(BIN)/python benches/compare/commits.py $(BASE)

## Accuracy, failures and time a fit beside other packages, into docs/rivals.md: an hour. RECORDS=target/rivals.json
## keeps what is computed, so that a run that was stopped goes on.
rivals: .venv/rivals/created
	.venv/rivals/bin/python benches/compare/accuracy.py $(if $(RECORDS),--keep $(RECORDS))
	.venv/rivals/bin/python benches/compare/joint_rivals.py --out docs/rivals.md

## docs/validation.md: report, benchmarks, coverage, twins, orders, bits; minutes when idle. ONLY=orders makes one section.
validate: .venv/dev
	$(BIN)/python benches/validate/validate.py $(if $(ONLY),--only $(ONLY))

## What fits of wrong and right set-ups warn of, into docs/trial.md: some ten minutes. ONLY= for some, without the page.
trial: .venv/dev
	$(BIN)/python benches/trial/trial.py $(if $(ONLY),--only "$(ONLY)")

## Memory of a study of 10^8 replicates into docs/faults.md: minutes; REPLICATES= for another number.
soak: .venv/dev
	$(BIN)/python benches/soak.py $(REPLICATES)

## Spoilt arguments to every public call; N= cases, SEED=. See docs/robustness.md.
fuzz: .venv/dev
	$(BIN)/python -W ignore fuzz/python/boundary.py --cases $(or $(N),100000) --seed $(or $(SEED),0)
	$(BIN)/python fuzz/python/many.py --cases $(or $(N),1000000) --seed $(or $(SEED),0)

## Licences and sources of all crates, held to deny.toml by cargo-deny (cargo install cargo-deny).
deny:
	cargo deny check licenses bans sources

## Texts of equations and files with bytes changed: N= how many, SEED= which; what ends in neither is printed.
fuzz-texts: .venv/dev
	$(BIN)/python -W ignore fuzz/python/texts.py --cases $(or $(N),100000) --seed $(or $(SEED),0)

## The same texts and files, guided by coverage: SECONDS= for each kind.
fuzz-guided: .venv/dev fuzz/requirements.txt
	$(BIN)/python -m pip install --quiet -r fuzz/requirements.txt
	for kind in equation signal csv npz mat fit study; do \
		$(BIN)/python -W ignore fuzz/python/guided.py $$kind --seconds $(or $(SECONDS),60) || exit 1; done

## The core alone, guided by coverage and under AddressSanitizer: SECONDS= for each target. Needs a nightly
## toolchain and cargo-fuzz (cargo install cargo-fuzz). What is found is written to fuzz/artifacts.
fuzz-core:
	cd fuzz && for target in $(FUZZED); do mkdir -p target/corpus/$$target && \
		cargo +nightly fuzz run $$target target/corpus/$$target corpus/$$target -- -max_total_time=$(or $(SECONDS),60) \
		-timeout=20 -rss_limit_mb=3000 -max_len=1024 -len_control=0 || exit 1; done

## Tests of the core under valgrind, which knows no AVX-512: minutes.
valgrind:
	MODFUN_ISA=plain PROPTEST_CASES=1 \
	CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="valgrind --quiet --error-exitcode=9 --suppressions=$(CURDIR)/fuzz/valgrind.supp" \
		cargo test --release --package modfun --test estimators --test joint --test terms -- --test-threads=1

## Instructions of the programs of benches/programs.rs, held to benches/counts.toml; UPDATE=1 writes it.
counts: .venv/created
	$(BIN)/python benches/counts.py $(if $(UPDATE),--update)

## The wheel, on Linux for every system from manylinux2014 on, into dist/; what it holds is checked.
wheel: .venv/packaging/created
	cargo fetch --locked --quiet
	RUSTFLAGS="--remap-path-prefix=$(CURDIR)=. $$(printf -- '--remap-path-prefix=%s=crates ' $(CRATES))" \
		PATH="$(CURDIR)/$(PACKAGING):$$PATH" maturin build --release --locked $(MANYLINUX) --out dist
	$(PACKAGING)/python packaging/contents.py dist
	$(PACKAGING)/twine check --strict dist/*.whl

## The sources with every crate they need, into dist/; they build without a network.
sdist: .venv/packaging/created
	$(PACKAGING)/python packaging/sdist.py
	$(PACKAGING)/python packaging/contents.py dist
	$(PACKAGING)/twine check --strict dist/*.tar.gz

## Builds the sources of dist/ with no crate in store, and without a network where root can take it away.
try-sdist: .venv/packaging/created
	rm -rf $(TRIED) && mkdir -p $(TRIED)/crates
	$(shell [ "$$(id -u)" = 0 ] && command -v unshare >/dev/null && echo unshare --net) env \
		CARGO_HOME=$(CURDIR)/$(TRIED)/crates CARGO_NET_OFFLINE=true PATH="$(CURDIR)/$(PACKAGING):$$PATH" \
		$(PACKAGING)/python -m pip wheel --quiet --no-build-isolation --no-deps --no-index \
		--wheel-dir $(TRIED) dist/*.tar.gz

## The wheel of dist/ in new environments, with the oldest versions it allows and the newest: see docs/release.md.
test-wheel:
	$(PYTHON) packaging/try_wheel.py oldest newest

## Writes THIRD_PARTY_LICENSES again, after a change of Cargo.lock.
licences:
	cargo fetch --locked --quiet
	$(PYTHON) packaging/licences.py

clean:
	rm -rf .venv target dist python/modfun/_core*.so

.venv/created:
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	touch $@

# The package with the extras that README's own lines need.
.venv/demo: .venv/created pyproject.toml Cargo.toml Cargo.lock $(RUST) $(shell find python -name '*.py')
	$(BIN)/python -m pip install --quiet ".[cli,report,symbolic]"
	touch $@

# The tools of the documentation site.
.venv/docs: .venv/dev docs/requirements.txt
	$(BIN)/python -m pip install --quiet -r docs/requirements.txt
	touch $@

# The rivals' tools, apart from those of development.
.venv/bench: .venv/dev benches/compare/requirements.txt
	$(BIN)/python -m pip install --quiet -r benches/compare/requirements.txt
	touch $@

# The tools that make and look into wheels.
.venv/packaging/created: .venv/created packaging/requirements.txt
	$(PYTHON) -m venv .venv/packaging
	$(PACKAGING)/python -m pip install --quiet -r packaging/requirements.txt
	touch $@

# modfun and its rivals on their own, since some of these hold others at old versions.
.venv/rivals/created: .venv/created benches/compare/rivals/requirements.txt pyproject.toml Cargo.lock $(RUST)
	$(PYTHON) -m venv .venv/rivals
	.venv/rivals/bin/python -m pip install --quiet . -r benches/compare/rivals/requirements.txt
	touch $@

# The package in place, with the tools for tests and lint.
.venv/dev: .venv/created pyproject.toml Cargo.toml Cargo.lock $(RUST)
	$(BIN)/python -m pip install --quiet "maturin>=1.9,<2"
	$(BIN)/maturin develop --quiet --release --extras dev
	touch $@
