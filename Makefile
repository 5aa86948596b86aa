.DEFAULT_GOAL := help
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

help: ## show this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

setup: $(READY) ## make .venv with the locked versions

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "selfmodel needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable . --group dev
	touch $@

demo: $(READY) ## recover a quadruped from a lost lower leg, showing what it does
	$(BIN)/selfmodel recover quadruped --case 1

test: $(READY) ## run the whole test suite
	$(BIN)/pytest

lint: $(READY) ## check style and formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY) ## check types, strictly
	$(BIN)/mypy
	$(BIN)/mypy benchmarks examples .ci

wheel: $(READY) ## build the wheel and check what it holds
	rm -rf build dist
	$(BIN)/python -m build --quiet --wheel
	$(BIN)/python .ci/check_wheel.py dist/*.whl

bench: $(READY) ## measure speed and memory; on a quiet machine
	$(BIN)/python -m benchmarks.bench

results: $(READY) ## run Table I on both robots and write docs/results.md; takes over an hour
	$(BIN)/python -m benchmarks.table_one

.PHONY: help setup demo test lint types wheel bench results
