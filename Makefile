# catseye: `make` lists the verbs. Needs Python >= 3.11 and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.catseye-installed
# Tests that lie together go to one worker, whose fixtures serve them all; bytecode is kept, for hundreds of processes start.
PYTEST := OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n auto --dist worksteal

.PHONY: help setup check test test-all demo bench release clean

help:  ## list the verbs
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "make %-9s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "catseye needs Python 3.11 or newer, this is " + sys.version.split()[0])'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

setup: $(STAMP)  ## make .venv and install catseye in it

check: setup  ## style, types, layers
	$(BIN)/ruff check src tests benchmarks studies
	$(BIN)/ruff format --check src tests benchmarks studies
	MYPY_NUM_WORKERS=2 $(BIN)/mypy
	$(BIN)/lint-imports

test: check  ## check, then the tests
	$(PYTEST)

test-all: check  ## the same with the long scatter and fault runs
	$(PYTEST) -m 'slow or not slow' --hypothesis-profile=explore

demo: setup  ## a night of raw samples from 18 rangers to coordinates, with a report in demo-night-01/
	$(BIN)/catseye demo demo-night-01

bench: setup  ## benchmarks, as ratios in one run: main job, phases, positions, networks, pointing, air, delays, living site, surfaces
	$(BIN)/python benchmarks/bench_reduce.py
	$(BIN)/python benchmarks/bench_phase.py
	$(BIN)/python benchmarks/bench_positions.py
	$(BIN)/python benchmarks/bench_network.py
	$(BIN)/python benchmarks/bench_pointing.py
	$(BIN)/python benchmarks/bench_air.py
	$(BIN)/python benchmarks/bench_delay.py
	$(BIN)/python benchmarks/bench_live.py
	$(BIN)/python benchmarks/bench_surface.py
	$(BIN)/python benchmarks/bench_structure.py

release: setup  ## a wheel in dist/
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

clean:  ## remove .venv and everything that can be made again
	rm -rf .venv dist demo-night-01 .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
