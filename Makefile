# What README and .ci/run call. Everything is installed into .venv and built into target.

PYTHON ?= python3
BIN := .venv/bin
FIGURES ?= figures
RUST := $(shell find rust -name '*.rs' -o -name 'Cargo.toml')

.PHONY: demo test test-rust test-python lint format docs bench rivals validate counts clean

## Builds, installs into .venv and reproduces the report's figures.
demo: .venv/demo
	$(BIN)/modfun reproduce report --out $(FIGURES)

## Every test, Rust and Python.
test: test-rust test-python

test-rust:
	cargo test --release -p modfun

test-python: .venv/dev
	$(BIN)/python -m pytest -q -n 2

## Formatting, clippy, ruff, types.
lint: .venv/dev
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: .venv/dev
	cargo fmt --all
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

## The documentation site into target/docs; a warning is an error.
docs: .venv/docs
	rm -rf docs/reference/generated
	$(BIN)/sphinx-build -E -W --keep-going -n -q -d target/doctrees docs target/docs

## modfun against its rivals into docs/benchmarks.md; stages and growth of costs into docs/performance.md.
bench: .venv/bench
	$(BIN)/python benches/compare/bench.py
	$(BIN)/python benches/compare/stages.py
	$(BIN)/python benches/compare/growth.py

## Accuracy, failures and time a fit beside other packages, into docs/rivals.md: an hour. RECORDS=target/rivals.json
## keeps what is computed, so that a run that was stopped goes on.
rivals: .venv/rivals/created
	.venv/rivals/bin/python benches/compare/accuracy.py $(if $(RECORDS),--keep $(RECORDS))

## docs/validation.md: report, benchmarks, coverage, oracles, orders, bits; half an hour. ONLY=orders makes one section.
validate: .venv/dev
	$(BIN)/python benches/validate/validate.py $(if $(ONLY),--only $(ONLY))

## Instructions a replicate, held to benches/counts.toml; UPDATE=1 writes it.
counts: .venv/created
	$(BIN)/python benches/counts.py $(if $(UPDATE),--update)

clean:
	rm -rf .venv target python/modfun/_core*.so

.venv/created:
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	touch $@

# What a user gets from `pip install "modfun[cli,plot]"`.
.venv/demo: .venv/created pyproject.toml Cargo.toml Cargo.lock $(RUST) $(shell find python -name '*.py')
	$(BIN)/python -m pip install --quiet ".[cli,plot]"
	touch $@

# The tools of the documentation site.
.venv/docs: .venv/dev docs/requirements.txt
	$(BIN)/python -m pip install --quiet -r docs/requirements.txt
	touch $@

# The rivals' tools, apart from those of development.
.venv/bench: .venv/dev benches/compare/requirements.txt
	$(BIN)/python -m pip install --quiet -r benches/compare/requirements.txt
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
