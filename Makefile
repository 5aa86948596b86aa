.DEFAULT_GOAL := help
PYTHON ?= python3
BIN := .venv/bin
SLOW := process or search or bodies or opengl or fuzz
READY := .venv/.ready
TOOLS := .venv/.tools
VIEWERS := .viewers
NODE_READY := .ci/viewers/node_modules/.ready
PAGE_READY := report_page/node_modules/.ready
BROWSER_READY := .ci/browser/node_modules/.ready

help: ## show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

setup: $(TOOLS) ## make .venv with the locked versions

page: $(PAGE_READY) ## build the page of `selfmodel report` after a change in report_page; needs Node.js
	node report_page/build.mjs

$(PAGE_READY): report_page/package.json report_page/package-lock.json
	@command -v npm >/dev/null || { echo 'make page needs Node.js 20 or newer with npm, and found none' >&2; exit 1; }
	npm ci --prefix report_page --ignore-scripts --no-audit --no-fund --silent
	touch $@

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13) and "selfmodel needs Python 3.11 or 3.12: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --no-compile --constraint constraints.txt --editable .
	touch $@

$(TOOLS): $(READY)
	$(BIN)/python -m pip install --no-compile --constraint constraints.txt --group dev --group docs
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --only-binary pybullet --group other-engine || echo 'no wheel of PyBullet for this platform: its tests are skipped'
	touch $@

demo: $(READY) ## recover a quadruped from a lost lower leg, showing what it does
	$(BIN)/selfmodel recover quadruped --case 1

picture: $(READY) ## draw the picture of the README from the newest run of `make demo`; needs EGL or OSMesa
	$(BIN)/python examples/plot_lanes.py "$$(ls -dt runs/quadruped-* | head -n 1)" docs/figures/lanes.png

test: $(TOOLS) ## run the fast tests: every promise, in two to three minutes on two cores
	$(BIN)/pytest --numprocesses auto --dist loadfile --durations 10

test-slow: $(TOOLS) ## run the tests that `make test` leaves out; in about six minutes on two cores
	$(BIN)/pytest -m "$(SLOW)" --numprocesses auto --dist loadfile --no-loadscope-reorder --durations 30

test-all: $(TOOLS) ## run every test, with every case; in about nine minutes on two cores
	$(BIN)/pytest -m "" --numprocesses auto --dist loadfile --no-loadscope-reorder --durations 30

docs: $(TOOLS) ## build the documentation site in docs/_build; warnings are errors
	$(BIN)/sphinx-build -W --keep-going -E -q -b html docs docs/_build/html

lint: $(TOOLS) ## check style and formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(TOOLS) ## check types, strictly
	$(BIN)/mypy
	$(BIN)/mypy benchmarks examples .ci

wheel: $(READY) ## build the wheel and check what it holds
	rm -rf dist
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	$(BIN)/python .ci/check_wheel.py dist/*.whl

versions: wheel ## use the wheel with the lowest and the highest versions of what it needs
	$(BIN)/python .ci/check_versions.py dist/*.whl

viewers: $(TOOLS) $(VIEWERS)/pymcap/.ready $(NODE_READY) ## prove that fresh logs open in other people's tools; needs Node.js
	rm -rf $(VIEWERS)/logs
	mkdir $(VIEWERS)/logs
	$(BIN)/selfmodel trial quadruped --out $(VIEWERS)/logs/quadruped.mcap
	$(BIN)/selfmodel trial hexapod --damage break:front_left_knee --out $(VIEWERS)/logs/hexapod.mcap
	$(BIN)/python .ci/viewers/check.py $(VIEWERS)/logs/quadruped.mcap $(VIEWERS)/logs/hexapod.mcap
	$(BIN)/python .ci/viewers/can_fail.py $(VIEWERS)/logs/quadruped.mcap
	node .ci/viewers/layout.mjs docs/foxglove-layout.json $(VIEWERS)/logs/quadruped.mcap

# pymcap-cli has an environment of its own: it is GPL, and no dependency.
$(VIEWERS)/%/.ready: .ci/viewers/requirements-%.txt
	rm -rf $(@D)
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet --disable-pip-version-check --requirement $<
	touch $@

$(NODE_READY): .ci/viewers/package.json .ci/viewers/package-lock.json
	@command -v npm >/dev/null || { echo 'make viewers needs Node.js 20 or newer with npm, and found none' >&2; exit 1; }
	npm ci --prefix .ci/viewers --ignore-scripts
	touch $@

browser: $(BROWSER_READY) $(PAGE_READY) ## install what tests build the page and drive a browser with; needs Node.js

$(BROWSER_READY): .ci/browser/package.json .ci/browser/package-lock.json
	@command -v npm >/dev/null || { echo 'make browser needs Node.js 20 or newer with npm, and found none' >&2; exit 1; }
	npm ci --prefix .ci/browser --ignore-scripts --no-audit --no-fund --silent
	touch $@

bench: $(TOOLS) ## measure speed and memory; on a quiet machine
	$(BIN)/python -m benchmarks.bench

PAPER ?= runs/paper
results: $(READY) ## repeat the paper's experiment in runs/paper, with its figures and tables; takes hours
	$(BIN)/selfmodel paper --out $(PAPER)
	$(BIN)/selfmodel paper --out $(PAPER) --robots quadruped --case 1,2,3,5,6,9 --comparator forward-displacement --seeds 10

FOREIGN ?= runs/foreign
GENERATE = $(BIN)/python -m benchmarks.foreign generate $(FOREIGN)
foreign: $(TOOLS) ## make the recordings of docs/results/foreign.md and score their diagnoses; takes days
	$(GENERATE) --cases break,jam,sensor,break+sensor,break+jam,onset --gaps none,moderate,large --seeds 50-51
	$(GENERATE) --cases healthy --gaps none,moderate,large --seeds 50-65
	$(GENERATE) --cases lost-encoder --gaps none,moderate,large --seeds 50
	$(GENERATE) --cases break-debris --gaps moderate,large --seeds 50-52
	$(GENERATE) --cases wide --gaps moderate,large --seeds 51-52
	$(GENERATE) --cases outside --gaps moderate,large --seeds 50-51
	$(GENERATE) --robots quadruped --cases default --gaps moderate --seeds 50-52
	$(GENERATE) --robots hexapod --cases default --gaps moderate --seeds 51
	$(GENERATE) --robots ant --cases break,jam,sensor,break+sensor,break+jam,healthy --gaps none,moderate,large --seeds 50
	$(BIN)/python -m benchmarks.foreign score $(FOREIGN)
	$(BIN)/python -m benchmarks.foreign table $(FOREIGN)/scores.jsonl --csv $(FOREIGN)/scores.csv

.PHONY: help setup page browser demo test test-slow test-all docs lint types wheel versions viewers bench results foreign
