# Everything runs from .venv, which is made from requirements.lock on first use. Paths are relative, so a path
# with a space is fine; a second run needs no network.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.installed

export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: install demo test lint schema bench clean

install: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version.split()[0] + ". Try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --require-hashes -r requirements.lock
	$(RUN) -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $(STAMP)

lint: $(STAMP)
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	$(VENV)/bin/lint-imports

demo: $(STAMP)
	$(RUN) -m companion sim missions/land_moving.yaml --camera rendered --seed 1 --record runs/demo

# The JSON Schemas by which editors complete and check missions and configurations.
schema: $(STAMP)
	$(RUN) -m companion.config.schema

# Short forms; each program says at its top how to run it in full.
bench: $(STAMP)
	$(RUN) bench/simulation_speed.py --quick
	$(RUN) bench/step.py --seconds 20
	$(RUN) bench/detector.py --repeats 5
	$(RUN) bench/planning.py
	$(RUN) bench/recording.py
	$(RUN) bench/estimators.py --runs 2
	$(RUN) bench/memory.py --minutes 2
	$(RUN) bench/link_fuzz.py --bytes 1000000

test: lint
	$(RUN) -m pytest -n 2 --dist worksteal -m "not sitl"
	$(RUN) -m pytest -m sitl

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .import_linter_cache build dist *.egg-info
