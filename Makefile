# Needs Python 3.11 or later, pip and make; everything else goes into .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# The exact versions that this release was tested with.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
DEMO := demo_result
EXPLORED := explore_result
# As the command has it: threads that wait for larger matrices keep a core from others.
export OPENBLAS_NUM_THREADS ?= 1
# What fits no table: from files to peak heights, and from results to reports.
QUICK := tests/data tests/batch tests/report/html tests/report/text tests/config

.PHONY: demo explore-demo ros test test-quick test-slow lint bench bench-honesty docs notebooks clean

demo: .stamps/run                ## The example grasp, from recordings to theta_c and alpha*
	$(BIN)/pushfit demo --out $(DEMO) --force

explore-demo: .stamps/run        ## The example grasp explored by a simulated hand to +- 3 degrees
	$(BIN)/pushfit explore --hand simulated --config examples/foam_box/grasp.toml \
	  --sigma 0.1 --out $(EXPLORED) --force

ros:                             ## What the nodes for a real robot need
	@$(BIN)/python -c "from pushfit.explore.hands.ros.messages import ros; ros(); print('ROS 1 is here')"

test: lint                       ## Everything that gates a change; minutes on two cores
	$(BIN)/pytest -q -n 2 --dist loadfile -m "not slow"

# Real recordings, where they are, and the checks of shapes double it; `test` has both.
test-quick: .stamps/test         ## Files, text, tables and reports, without a fit; a minute
	PUSHFIT_REAL_DATA=none $(BIN)/pytest -q -n 2 --dist loadfile -m "not slow" \
	  --jaxtyping-packages= $(QUICK)

test-slow: .stamps/test          ## Statistical calibration and other long tests; over an hour
	$(BIN)/pytest -q -n 2 --dist loadfile -m slow

lint: .stamps/test
	$(BIN)/ruff check --quiet
	$(BIN)/ruff format --check --quiet
	$(BIN)/pyright --warnings

bench: .stamps/bench             ## Speed beside lmfit, SciPy, emcee and pandas; minutes
	$(BIN)/pytest -q -p no:xdist -o addopts=--import-mode=importlib --benchmark-quiet benchmarks

bench-honesty: .stamps/bench     ## What lmfit and SciPy say where nothing is determined
	$(BIN)/python -m benchmarks.inference.honesty

docs: .stamps/docs               ## The documentation as web pages, in site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

notebooks: .stamps/test          ## The notebooks of the examples from their scripts
	$(BIN)/jupytext --quiet --to ipynb examples/notebooks/*.py

clean:
	rm -rf .stamps $(DEMO) $(EXPLORED)* site dist build .pytest_cache .ruff_cache .hypothesis

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

.stamps/run: $(BIN)/python pyproject.toml constraints.txt
	$(INSTALL) -e '.[report]'
	mkdir -p .stamps && touch $@

.stamps/%: $(BIN)/python pyproject.toml constraints.txt
	$(INSTALL) -e '.[$*]'
	mkdir -p .stamps && touch $@
