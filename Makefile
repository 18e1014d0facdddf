# What README and .ci/run call. Everything lives in .venv and target; nothing else is touched.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FIGURES ?= figures

.PHONY: demo test test-rust test-python lint bench format wheel clean

# Installed once per change of pyproject.toml.
$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet "maturin>=1.9,<2"
	touch $@

# Tools for tests and lint, the project's own extra `dev`.
$(VENV)/dev: $(VENV)/installed
	$(BIN)/python -m pip install --quiet $$($(BIN)/python tools/requirements.py cli plot pandas control dev)
	touch $@

$(VENV)/demo: $(VENV)/installed
	$(BIN)/python -m pip install --quiet $$($(BIN)/python tools/requirements.py cli plot)
	touch $@

SOURCES := $(shell find rust -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock pyproject.toml README.md

# The extension, optimised, in place.
$(VENV)/built: $(VENV)/installed $(SOURCES)
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --quiet --skip-install
	touch $@
