# Two commands, each does its own set-up on a machine that has Python 3.10 or later and make:
#   make replay   the whole method on the embedded stream, and a page that plays it
#   make test     every check
# For those who change it: `make quick` (the quick tests, a minute on two cores), `make check` (the checks short of the tests), `make format`, `make hooks` (checks at each commit).
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin

.PHONY: replay test quick check format hooks clean

replay: $(VENV)/.run
	$(BIN)/modt replay --frames 0:60 --out runs/embedded
	$(BIN)/modt-profile report runs/embedded
	$(BIN)/modt view runs/embedded
	@echo "To look at it: open runs/embedded/view.html in a browser"

# Two processes share the tests file by file, in the order of tests/conftest.py. Threads of BLAS would get in their way.
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -p no:cacheprovider --numprocesses=2 --dist=loadfile --no-loadscope-reorder

test: check
	$(PYTEST)

quick: $(VENV)/.test
	$(PYTEST) -m "not slow and not command and not install and not kitti"

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
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[progress,view]'
	@touch $@

$(VENV)/.test: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[test,progress]'
	@touch $@
