# `make` alone lists the targets.
PYTHON ?= python3

VENV := .venv
RUN := $(VENV)/bin/python
PIP := $(RUN) -m pip --disable-pip-version-check --no-input --quiet

# Nothing but the locked environment may be imported.
unexport PYTHONPATH PYTHONHOME
# Nor may a local store of packages decide which versions and files the lock names.
unexport UV_INDEX UV_EXTRA_INDEX_URL UV_FIND_LINKS UV_CONSTRAINT UV_OVERRIDE UV_EXCLUDE_NEWER

.PHONY: help reproduce sensitivity site quick draw test test-all bench lint readme lock clean
.DELETE_ON_ERROR:

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-13s%s\n", $$1, $$2 }' Makefile
	@echo 'The first target builds $(VENV) from environment.lock; PYTHON=python3.12 names its interpreter.'

# The exit code is 1 if bytes differ from those that are published; the site is built all the same.
reproduce: $(VENV)/.ready ## run the three tasks, judge each claim, build the site
	$(VENV)/bin/replicate run open_maze obstacle_maze soccer claims --here --check; status=$$?; \
	    $(VENV)/bin/replicate site && exit $$status

sensitivity: $(VENV)/.ready ## what the verdicts depend on, and what the idea is worth beside others
	$(VENV)/bin/replicate run beyond rounding calibration sensitivity --here --check

site: $(VENV)/.ready ## build the report from what is published in figures/, into build/site
	$(VENV)/bin/replicate site

quick: $(VENV)/.ready ## the paper with few trials, into build/quick
	$(VENV)/bin/replicate run open_maze obstacle_maze soccer claims --profile quick --out build/quick

test: $(VENV)/.ready ## run the tests
	$(RUN) -m pytest -n 2

test-all: $(VENV)/.ready ## run also those that take minutes: a hundred kills, ten thousand files
	$(RUN) -m pytest -n 2 -m "long or not long"

bench: $(VENV)/.ready ## measure speed
	$(RUN) -m pytest benchmarks -s

lint: $(VENV)/.ready ## check style, types and the lock
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	$(RUN) tools/check_lock.py

draw: $(VENV)/.ready ## redraw every figure from the table beside it; nothing is executed
	$(VENV)/bin/replicate draw

readme: $(VENV)/.ready ## bring the claims in README.md up to date with figures/
	$(RUN) tools/readme.py

# One version of a package for all Pythons (--fork-strategy fewest): the same numbers everywhere.
# What is pinned stays, since results depend on it; `make lock UPGRADE=--upgrade` pins the newest.
lock: $(VENV)/.ready ## pin in environment.lock what it lacks, and check it on every Python
	$(RUN) -m uv pip compile --no-config --quiet --universal --fork-strategy fewest --python-version 3.11 \
	    --generate-hashes --only-binary :all: $(UPGRADE) --no-annotate \
	    --extra notebooks --extra cluster --extra minari --extra site --extra dev \
	    --custom-compile-command 'make lock' --output-file environment.lock pyproject.toml
	$(RUN) tools/check_lock.py
	@set -e; for version in 3.11 3.12 3.13; do \
	    echo "resolving environment.lock for Python $$version"; \
	    $(RUN) -m uv pip install --no-config --quiet --dry-run --python-version $$version --target build/lock \
	        --require-hashes --only-binary :all: --requirement environment.lock; \
	done

clean: ## remove build products and caches (not .venv)
	rm -rf build mutants figures/.runs.json *.egg-info .benchmarks .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -path './$(VENV)' -prune -o \
	    \( -name __pycache__ -o -name .ipynb_checkpoints \) -type d -prune -exec rm -rf {} +

# The stamps are written last, so a set-up that broke off starts again from nothing; so does one
# that was copied or moved here, since it would import the other folder's source.
ifneq "$(shell cat $(VENV)/.ready 2>/dev/null)" "$(CURDIR)"
.PHONY: $(VENV)/.locked
endif

$(VENV)/.locked: environment.lock
	@"$(PYTHON)" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null || { \
	    echo 'error: $(PYTHON) is not Python 3.11, 3.12 or 3.13; name one: make PYTHON=python3.12' >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	    echo 'error: $(PYTHON) cannot make virtual environments; on Debian: apt install python3-venv' >&2; exit 1; }
	@echo 'building $(VENV) from environment.lock (a minute or two)'
	@rm -rf $(VENV)
	@"$(PYTHON)" -m venv $(VENV)
	@$(PIP) install --require-hashes --only-binary :all: --requirement environment.lock
	@touch $@

$(VENV)/.ready: $(VENV)/.locked pyproject.toml
	@echo 'installing the package itself'
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@pwd -P > $@
