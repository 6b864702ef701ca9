# Two commands, each does its own set-up on a machine that has Python 3.10 or later and make:
#   make replay   the whole method on the embedded stream, and a page that plays it
#   make test     every check
# For those who change it: `make quick` (the quick tests, a minute on two cores), `make check` (the checks short of the tests), `make format`, `make hooks` (checks at each commit).
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin

.PHONY: replay test test-one test-other quick quick-one quick-other check format hooks clean

replay: $(VENV)/.run
	$(BIN)/modt replay --out runs/embedded
	$(BIN)/modt-profile report runs/embedded
	$(BIN)/modt view runs/embedded
	@echo "To look at it: open runs/embedded/view.html in a browser"

# The tests run in two halves at a time. Those that exchange ROS 2 messages stand in one of them.
HALVES := $(MAKE) --no-print-directory --jobs=2 --output-sync=target
PYTEST := $(BIN)/python -m pytest -p no:cacheprovider
ONE    := tests/app tests/classification tests/modt_commands tests/modt_evaluation tests/modt_profiling tests/modt_simulation tests/modt_viewer tests/extending tests/fuzz tests/segmentation tests/sensor_fit
QUICK  := -m "not slow and not command and not install and not kitti"

test: check
	$(HALVES) test-one test-other

test-one: $(VENV)/.test
	$(PYTEST) $(ONE)

test-other: $(VENV)/.test
	$(PYTEST) tests $(ONE:%=--ignore=%)

quick: $(VENV)/.test
	$(HALVES) quick-one quick-other

quick-one: $(VENV)/.test
	$(PYTEST) $(QUICK) $(ONE)

quick-other: $(VENV)/.test
	$(PYTEST) $(QUICK) tests $(ONE:%=--ignore=%)

check: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	PYTHONPATH=runtime:tools $(BIN)/lint-imports

format: $(VENV)/.test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

hooks: $(VENV)/.test
	$(BIN)/python -m pip install --quiet 'pre-commit>=3.5'
	$(BIN)/pre-commit install

clean:
	rm -rf $(VENV) runs build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache

$(BIN)/python:
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 10), "modt needs Python 3.10 or later; give PYTHON=..."'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/.run: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[progress,view]'
	@touch $@

$(VENV)/.test: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[test,progress]'
	@touch $@
