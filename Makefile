# Everything runs from .venv, which is made from requirements.lock on first use. Paths are relative, so a path
# with a space is fine; a second run needs no network.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.installed

export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: install demo test test-px4 test-clients lint schema bench fidelity clean

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

# The JSON Schemas by which editors complete and check missions and configurations, and the page on which every key stands.
schema: $(STAMP)
	$(RUN) -m companion.config.schema
	$(RUN) -m companion.config.reference

# Short forms; each program says at its top how to run it in full.
bench: $(STAMP)
	$(RUN) bench/simulation_speed.py --quick
	$(RUN) bench/cubesat_simulation.py --seconds 20
	$(RUN) bench/step.py --seconds 20
	$(RUN) bench/detector.py --repeats 5
	$(RUN) bench/planning.py
	$(RUN) bench/scp.py
	$(RUN) bench/recording.py
	$(RUN) bench/estimators.py --runs 2
	$(RUN) bench/memory.py --minutes 2
	$(RUN) bench/setpoint_gap.py
	$(RUN) bench/takeover.py --trials 7
	$(RUN) bench/link_fuzz.py --bytes 1000000

# The simulator beside recordings of PX4; a small extract in tests/data serves where the folder is missing.
fidelity: $(STAMP)
	$(RUN) -m sitl_stub.fidelity $(FIDELITY)

# Flights in real time leave much of two cores idle: the other tests run beside them, at the lowest priority.
test: lint
	@flights=$$(mktemp); trap 'kill $$others; rm -f $$flights; exit 130' INT TERM; \
	nice -n 19 $(RUN) -m pytest -n 2 --dist worksteal -m "not sitl and not px4 and not clients" & others=$$!; \
	$(RUN) -m pytest -m sitl > $$flights 2>&1; flown=$$?; \
	wait $$others; tested=$$?; cat $$flights; rm -f $$flights; exit $$((flown || tested))

# Missions on PX4 with SIH; docs/px4_sitl.md. PX4: where the companion hears it, PX4_WORLD: the world, PX4_START: what
# starts it anew for each flight (empty: it runs already), PX4_MISSIONS: which, instead of the three that land.
PX4 ?= udp://127.0.0.1:14540
PX4_WORLD ?= udp://127.0.0.1:14550
PX4_START ?=
PX4_FLIGHTS ?= 1
PX4_MISSIONS ?=
export PX4 PX4_WORLD PX4_START PX4_FLIGHTS PX4_MISSIONS

test-px4: $(STAMP)
	$(RUN) -m pytest -m px4 tests/px4

# MAVSDK and MAVProxy against the simulator, in an environment of their own: they need other packages than the companion.
CLIENTS := .venv-clients

$(CLIENTS)/.installed: tests/clients/requirements.txt
	$(PYTHON) -m venv $(CLIENTS)
	$(CLIENTS)/bin/python -m pip install --quiet --no-deps -r tests/clients/requirements.txt
	@touch $@

test-clients: $(STAMP) $(CLIENTS)/.installed
	CLIENTS_PYTHON=$(CLIENTS)/bin/python $(RUN) -m pytest -m clients tests/clients

clean:
	rm -rf $(VENV) $(CLIENTS) .pytest_cache .mypy_cache .ruff_cache .import_linter_cache build dist *.egg-info
