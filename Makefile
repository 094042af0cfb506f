# catseye: `make` lists the verbs. Needs Python >= 3.11 and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.catseye-installed
# A worker more than cores, as a fifth of the time tests wait. What lies together goes to one worker, whose fixtures serve
# it all; processes that tests start find their bytecode made.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print(1 + (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()))')
PYTEST := OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

.PHONY: help setup check style types test tests test-all test-web front front-check docs demo evidence bench bench-guard release lower-bounds clean

help:  ## list the verbs
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "catseye needs Python 3.11 or newer, this is " + sys.version.split()[0])'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,web,pdf,scale]'
	@touch $@

setup: $(STAMP)  ## make .venv and install catseye in it

check: style types  ## style, types, layers

style: setup
	$(BIN)/ruff check src tests benchmarks studies tools docs
	$(BIN)/ruff format --check src tests benchmarks studies tools docs
	$(BIN)/lint-imports

types: setup
	$(BIN)/mypy

test: style  ## check, and the tests: types beside them, as a core is idle now and then
	$(MAKE) --no-print-directory --jobs 2 types tests

test-all: style  ## the same with the long scatter and fault runs
	$(MAKE) --no-print-directory --jobs 2 types tests TESTS="-m 'not browser' --hypothesis-profile=explore --timeout=7200"

tests: setup
	$(PYTEST) $(TESTS)

test-web: setup  ## pages in a browser, and the front end built again: wants Node 20.19 and Chromium, says what it lacks
	$(BIN)/python tests/browser/prerequisites.py || exit 0; \
	$(MAKE) --no-print-directory front/node_modules || { echo "tests of the pages SKIPPED: npm ci failed (registry?)"; exit 0; }; \
	$(MAKE) --no-print-directory front-check && \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[test-web]' && \
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m browser tests/browser

front/node_modules: front/package-lock.json
	cd front && npm ci --silent
	@touch $@

front: front/node_modules  ## the dashboard and the reports' script, from front/ into the package: wants Node
	cd front && npm run --silent build

front-check: front/node_modules  # types, and the committed files against a new build, byte by byte
	cd front && npm run --silent check && npm test --silent
	cd front && rm -rf built && npx vite build --logLevel warn --outDir built/web && \
	npx vite build --config vite.report.config.ts --logLevel warn --outDir built/report
	diff -r front/built/web src/catseye/web/static
	diff -r front/built/report src/catseye/gateways/writers/static

docs: setup  ## the documentation in docs/_build/html: strict, every command executed, links and words checked, opens from disk
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[docs]'
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/docs/make_docs.py docs docs/_build

demo: setup  ## a night of raw samples from 18 rangers to coordinates, with a report in demo-night-01/
	$(BIN)/catseye demo demo-night-01

evidence: setup  ## scatter against claims, wrong records, peers' answers: writes docs/evidence/how-good.md
	PYTHONPATH=tests OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/evidence/run.py

bench: setup  ## all benchmarks beside others and the machine's limit, in one table: writes docs/benchmarks.md
	$(BIN)/python benchmarks/run.py --write

bench-guard: setup  ## their quick rows: fails where a ratio fell by a third against the table of `make bench`
	$(BIN)/python benchmarks/run.py --guard

release: setup  ## wheel and source in dist/, the same bits twice, tried in clean environments (RELEASE=--build-only)
	$(BIN)/python tools/release.py $(RELEASE)

lower-bounds: setup  ## the wheel with the lowest versions that pyproject.toml allows, on the oldest Python
	$(BIN)/python tools/release.py --lower-bounds

clean:  ## remove .venv and everything that can be made again
	rm -rf .venv dist demo-night-01 docs/_build front/node_modules front/built .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
