# Everything runs on .venv in this checkout. `make help` lists the targets.
PYTHON ?= python3
VENV := .venv
# what setup installs, with hashes; `make setup LOCK=` takes the newest that pyproject.toml allows instead
LOCK := requirements.lock
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
EXTRAS := formats,interactive,dev,docs,trial,live,aircraft
comma := ,
PIP = $(BIN)/python -m pip --quiet --disable-pip-version-check
UPGRADE := --upgrade
RESULTS := results
DEMO ?= friction
TRIAL_SEED ?= 1
TRIAL_KEY ?= $(HOME)/.config/sloshlab/trial_$(TRIAL_SEED).key
RIVALS_SEED ?= 4101
RECORDINGS := raw_data/numerical_tank/shaker
ROM := $(RESULTS)/rom/ROM.nc
MAPS := $(RESULTS)/shaker/maps.nc
SCALING_ROM := $(RESULTS)/tank_scaling/ROM_60x20.nc
BALLS :=
BALL := $(RESULTS)/bouncing_ball/decay_contact/ball.toml
PATIENCE ?= 30
REPLAYED ?= raw_data/shaker
FUZZ_SECONDS ?= 600
# one more than cores: tests of devices wait for a clock most of their time
TEST_WORKERS ?= 3
# every recording is read in a fork, and a fork copies a table of all pages: in large ones it takes a third
LARGE_PAGES = GLIBC_TUNABLES=glibc.malloc.hugetlb=1 PYTHONMALLOC=malloc
# there are more workers than cores: threads of one only wait for those of another
ONE_THREAD = OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
# of random inputs a tenth in `make test`, all in `make test-all`
FEWER = SLOSHLAB_FEWER_EXAMPLES=1
# a test that waits for ever would end as a run that is stopped and names none; the slow ones take longer than this
LONGEST_TEST = --timeout 600
# a file by one worker, in the order of tests/measured_times.csv
PYTEST = $(LARGE_PAGES) $(ONE_THREAD) $(BIN)/python -m pytest -n $(TEST_WORKERS) --dist loadfile --no-loadscope-reorder
BENCH ?=
VERSION = $(shell sed -n 's/^__version__ = "\(.*\)"/\1/p' sloshlab/_version.py)
DOCS_BRANCH ?= gh-pages

# empty is unset for Python: without compiled modules every command that a test starts would compile the project anew
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.PHONY: help setup lock demo demo-cases shaker beam sdof bouncing-ball rom flutter-checks aircraft wing rom-study closed-loop replay campaign tank-campaign tank-scaling pictures tank-diagnosis trial flight-trial rivals test test-times test-newest test-all lint format type bench bench-history bench-table fuzz soak wheel docs docs-publish clean tank-reference ball-network fill-level small-motion

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## */\t/' | expand -t 12

setup: $(STAMP)  ## create .venv with everything for normal use

$(STAMP): pyproject.toml $(LOCK)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "sloshlab needs Python 3.11 or newer; remedy: make PYTHON=/path/to/python3.11 setup" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
ifneq ($(LOCK),)
# pip would make bytecode file by file on one core, and of all tests of all packages, a quarter of the text
	$(PIP) install --no-compile --require-hashes --requirement $(LOCK)
	$(BIN)/python -m compileall -qq -j 0 -x '/tests/' $(VENV)/lib || true
	$(PIP) install --no-deps --no-build-isolation --editable .
else
	$(PIP) install --upgrade pip
	$(PIP) install --editable '.[$(EXTRAS)]'
endif
	@touch $@

lock:  ## requirements.lock anew, with the newest versions; UPGRADE= keeps those that may stay
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check uv
	echo 'setuptools>=77' | build/lock/bin/uv pip compile --quiet --universal --python-version 3.11 $(UPGRADE) \
	  $(addprefix --extra ,$(subst $(comma), ,$(EXTRAS))) --generate-hashes --no-annotate \
	  --custom-compile-command 'make lock' --output-file requirements.lock pyproject.toml -

demo: setup  ## physics hidden in a laboratory run, found, and shown beside the truth (or DEMO=name)
	$(BIN)/sloshlab demo $(DEMO) -o $(RESULTS)/demo/$(DEMO) || test $$? -eq 3

shaker: setup  ## the shaker experiment on the numerical tank (or RECORDINGS=folder): maps and report
	$(BIN)/python -m pipelines.experiments shaker $(RECORDINGS) $(RESULTS)/shaker

beam: setup  ## the beam of raw_data/numerical_tank: damping, modes, spectra and report
	$(BIN)/python -m pipelines.experiments beam raw_data/numerical_tank/beam $(RESULTS)/beam

sdof: setup  ## the guided tank of raw_data/numerical_tank: damping and report
	$(BIN)/python -m pipelines.experiments sdof raw_data/numerical_tank/sdof $(RESULTS)/sdof

bouncing-ball: setup  ## bouncing balls in place of the liquid of raw_data: parameters, maps, errors, reports (minutes)
	$(BIN)/python -m pipelines.experiments ball raw_data $(RESULTS)/bouncing_ball

ball-network: setup  ## a network that learns from a bouncing ball (7 x 35), in place of the liquid: report (minutes)
	test -f $(BALL) || $(BIN)/sloshlab ball raw_data/numerical_tank/sdof/decay_*.nc \
	  --rig raw_data/numerical_tank/sdof/rig_sdof.toml -o $(dir $(BALL)) || [ $$? -eq 3 ]
	$(BIN)/sloshlab ball-network raw_data/numerical_tank/sdof/decay_*.nc --ball $(BALL) \
	  --rig raw_data/numerical_tank/sdof/rig_sdof.toml -o $(RESULTS)/ball_network || [ $$? -eq 3 ]

rom: setup  ## the reduced-order model (70 delays, 35 neurons) of raw_data/numerical_tank and its validation report (minutes)
	$(BIN)/python -m pipelines.experiments rom raw_data/numerical_tank/shaker $(RESULTS)/rom

closed-loop: setup  ## the beam with the model of `make rom` (or ROM=file) and balls (BALLS=files) in its tank: report
	$(BIN)/sloshlab beam raw_data/numerical_tank/beam/*.nc --rig raw_data/numerical_tank/beam/rig_beam.toml \
	  --rom $(ROM) $(addprefix --ball ,$(BALLS)) -o $(RESULTS)/closed_loop || [ $$? -eq 3 ]

flutter-checks: setup  ## numbers of aeroelasticity, asked and reached, and a flying wing with a tank (2 min)
	mkdir -p $(RESULTS)
	$(BIN)/python -m studies.flutter_checks $(RESULTS)/flutter_checks.json
	$(BIN)/sloshlab flutter raw_data/aircraft/maewing1/case_1.toml -o $(RESULTS)/flutter

aircraft: setup  ## a flying wing with one tank and with two: flutter, gusts, places of the tanks, with $(ROM) of `make rom` (minutes)
	for case in 1 2; do $(BIN)/sloshlab aircraft raw_data/aircraft/maewing1/case_$$case.toml --rom $(ROM) \
	  --cache $(RESULTS)/aircraft/forces $$([ $$case = 1 ] || echo --scan raw_data/aircraft/maewing1/offset_scan.toml) \
	  -o $(RESULTS)/aircraft/case_$$case || [ $$? -eq 3 ] || exit 1; done

wing: setup  ## the wing with eight tanks, with the model of `make rom` and maps of `make shaker` (or ROM=, MAPS=): report
	$(BIN)/sloshlab wing raw_data/aircraft/single_aisle/wing.toml --rom $(ROM) --maps $(MAPS) --match-fold 323 \
	  --cache $(RESULTS)/forces -o $(RESULTS)/wing || [ $$? -eq 3 ]

rom-study: setup  ## the sensitivity study of reduced-order models (up to an hour; goes on where it was stopped)
	$(BIN)/python -m pipelines.experiments study raw_data/numerical_tank/shaker $(RESULTS)/rom_study

replay: setup  ## every recording of raw_data/shaker (or REPLAYED=folder) through simulated serial and CAN devices (PATIENCE=s for an answer)
	$(BIN)/python -m pipelines.experiments replay $(REPLAYED) $(RESULTS)/replay --patience $(PATIENCE)

campaign: setup  ## make the recordings of raw_data/shaker again
	$(BIN)/sloshlab virtual campaign -o raw_data/shaker

demo-cases: setup  ## draw the sealed cases of raw_data/cases again (a minute)
	$(BIN)/python -m pipelines.demonstration.ready_made raw_data/cases

tank-campaign: setup  ## compute the recordings of raw_data/numerical_tank again (hours; goes on where it was stopped)
	$(BIN)/sloshlab virtual campaign --liquid numerical -o raw_data/numerical_tank

tank-scaling: setup  ## the scaling law tested: the numerical tank at seven sizes (15 min; goes on where it was stopped)
	mkdir -p $(RESULTS)/tank_scaling
	test -f $(SCALING_ROM) || $(BIN)/sloshlab train raw_data/numerical_tank/shaker/fill_0.50_vfa_480s.nc \
	  raw_data/numerical_tank/shaker/fill_0.50_vfa_240s.nc --rig raw_data/numerical_tank/shaker/rig_fill_0.50.toml \
	  --still raw_data/numerical_tank/shaker/fill_0.50_empty_3.00g.nc \
	  --still raw_data/numerical_tank/shaker/fill_0.50_frozen_3.00g.nc --delays 60 --neurons 20 --no-report -o $(SCALING_ROM)
	$(BIN)/python -m studies.tank_scaling $(RESULTS)/tank_scaling --model $(SCALING_ROM)

fill-level: setup  ## the fill level as an input of the network: five fills, each left out (20 min; goes on where it was stopped)
	$(BIN)/python -m studies.fill_level $(RESULTS)/fill_level

small-motion: setup  ## why networks err in small motion: amplitude, zero crossings or the liquid (an hour; goes on where it was stopped)
	$(BIN)/python -m studies.small_motion $(RESULTS)/small_motion

pictures: setup  ## the snapshots and the film of the numerical tank in docs/images again (minutes)
	$(BIN)/python -m studies.numerical_tank_figures --rig raw_data/shaker/rig_fill_0.50.toml

tank-diagnosis: setup  ## what twins with simpler liquids leave out of the numerical tank's recordings (minutes)
	$(BIN)/python -m studies.tank_diagnosis raw_data/numerical_tank $(RESULTS)/tank_diagnosis

tank-reference: setup  ## OpenFOAM's tank beside the numerical one (hours; needs interFoam; goes on where it was stopped)
	$(BIN)/python -m studies.tank_reference $(RESULTS)/tank_reference

trial: setup  ## a blind trial, sealed, diagnosed and scored (hours; goes on where it was stopped)
	test -f $(RESULTS)/trial/commitments.json || $(BIN)/sloshlab trial seal -o $(RESULTS)/trial --seed $(TRIAL_SEED) --key $(TRIAL_KEY)
	env -u MAKEFLAGS -u TRIAL_KEY $(BIN)/sloshlab trial run $(RESULTS)/trial || test $$? -eq 3
	$(BIN)/sloshlab trial score $(RESULTS)/trial --key $(TRIAL_KEY) -o $(RESULTS)/trial_scores

flight-trial: setup  ## sixty virtual flights, sealed, diagnosed and scored (hours; goes on where it was stopped)
	mkdir -p $(RESULTS) $(dir $(TRIAL_KEY))
	test -f $(RESULTS)/flight_trial/commitments.json || { \
	  $(BIN)/sloshlab virtual flight --model docs/examples/flight_wing.toml --cases 60 --seed $(TRIAL_SEED) \
	    --truths $(TRIAL_KEY).flights.json -o $(RESULTS)/flight_trial && \
	  $(BIN)/sloshlab trial commit $(RESULTS)/flight_trial $(TRIAL_KEY).flights.json \
	    -o $(TRIAL_KEY).flights.locked --key $(TRIAL_KEY) && rm $(TRIAL_KEY).flights.json; }
	env -u MAKEFLAGS -u TRIAL_KEY $(BIN)/sloshlab trial run $(RESULTS)/flight_trial --time-limit 900 || test $$? -eq 3
	$(BIN)/sloshlab trial score $(RESULTS)/flight_trial --truths $(TRIAL_KEY).flights.locked --key $(TRIAL_KEY) \
	  -o $(RESULTS)/flight_trial_scores

rivals: setup  ## other ways to answer the cases of `make trial`, marked alike; needs the extra peers (hours)
	test -f $(RESULTS)/trial_development/commitments.json || \
	  $(BIN)/sloshlab trial seal --development --seed $(RIVALS_SEED) --cases 60 -o $(RESULTS)/trial_development
	$(BIN)/python -m studies.rivals $(RESULTS)/trial --key $(TRIAL_KEY) --training $(RESULTS)/trial_development \
	  -o $(RESULTS)/rivals

test: setup  ## the tests, about a quarter of an hour on 2 cores
	$(FEWER) $(PYTEST) $(LONGEST_TEST) -m "not slow"

test-times: setup  ## the tests, and what each file of them costs into tests/measured_times.csv
	$(FEWER) $(PYTEST) $(LONGEST_TEST) -m "not slow" -p tests.measured_times

test-newest:  ## the tests with the newest dependencies, in an environment of their own
	rm -rf .venv-newest
	$(MAKE) test VENV=.venv-newest LOCK=

test-all: setup  ## all tests
	$(PYTEST)

lint: setup  ## style and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

format: setup  ## put the code into the project's format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

type: setup  ## static types
	$(BIN)/mypy

bench: setup  ## speed and memory as ratios in one run (or BENCH="twin start", groups of them), kept in results/bench.json
	$(BIN)/python -m tests.benchmarks $(BENCH)

bench-history: setup  ## the figures of the last `make bench` into the history of revisions, and its figure in docs
	$(BIN)/python -m tests.benchmarks.history

bench-table:  ## the last `make bench` beside its aims, as a table in Markdown
	@$(BIN)/python -m tests.benchmarks.table

fuzz: setup  ## damaged files to every reader, for FUZZ_SECONDS (600): no crash, no hang, no more than 2 GiB
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS)

soak: setup  ## ten minutes of recording at full load, by serial, socketcand and slcan
	for transport in serial socketcand slcan; do $(BIN)/python -m tests.benchmarks.sustained $$transport --duration 600 || exit 1; done

wheel: setup  ## the wheel, installed into an environment of its own and used in an empty folder
	PYTHON=$(CURDIR)/$(BIN)/python .ci/wheel

docs: setup  ## the documentation as a web site in site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

docs-publish: docs  ## the site as VERSION and as the latest into the local branch DOCS_BRANCH (gh-pages)
	PATH="$(abspath $(BIN)):$$PATH" NO_MKDOCS_2_WARNING=1 $(BIN)/mike deploy --branch $(DOCS_BRANCH) --update-aliases $(VERSION) latest
	$(BIN)/mike set-default --branch $(DOCS_BRANCH) latest

clean:  ## remove everything that make made, the environment included
	rm -rf $(VENV) .venv-newest $(RESULTS) site docs/generated build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
