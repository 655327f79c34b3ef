# The commands to work with; CONTRIBUTING.md says when to use which.
#
# DOCS    the form that the documentation is built in: html, or linkcheck to try outer links too
# PYTHON  the Python to use, 3.10 or newer; of several, as in PYTHON='python3.13 python3', the first that is here
# DISTRO  the ROS 2 to take from PyPI where none is sourced: jazzy (as by default) or kilted
# QUICK   anything: bench, stop-matrix, console-matrix measure little, in minutes; docs stay as they are
# MARKED  which tests: `ros`, `not ros`, `slow` ...; all by default, but for documents (make docs)
# WORKERS how many processes share the real-time tests, which mostly wait; 0: one after the other
# ADDRESS where the discovery server listens; by default on this machine alone
# NO_BARS anything: bench does not fail when a threshold is missed

PYTHON ?= python3
python := $(firstword $(foreach one,$(PYTHON),$(shell $(one) -c 'print("$(one)")' 2>/dev/null)) $(PYTHON))
DISTRO ?=
DOCS ?= html
MARKED ?=
WORKERS ?= 7
ADDRESS ?=
VENV := .venv$(addprefix -,$(filter-out jazzy,$(DISTRO)))
SET_UP := @$(python) tools/set_up.py $(addprefix --distro=,$(DISTRO))

# Tests start hundreds of programs; each would compile the package again.
unexport PYTHONDONTWRITEBYTECODE

AS_ROOT := $(if $(filter-out 0,$(shell id -u)),sudo)

.DEFAULT_GOAL := help
.PHONY: help run console fleet discovery-server fleet-bench test test-all test-lowest check floor bench stop-matrix console-matrix mutants \
    colcon docs setup browser lock clean

help:  ## print this list
	@echo 'make TARGET [PYTHON=python3.12] [DISTRO=kilted]'
	@sed -n 's/^\([a-z-]*\):.*## /  \1\t/p' Makefile

run: setup  ## set up (seconds, and the download the first time), then drive a simulated robot; 11 s
	$(VENV)/bin/kachaka_simple_control --sim

console: setup  ## set up, then serve the console of a simulated robot, for a browser on this machine
	$(VENV)/bin/kachaka_console --sim

fleet: setup  ## set up, then drive two simulated robots in step; 40 s
	$(VENV)/bin/kachaka_fleet minuet --sim

discovery-server: setup  ## run what programs find each other by where multicast fails; ADDRESS=192.168.1.10
	@tools/discovery_server.sh $(VENV) $(ADDRESS)

# Pure tests first, on all cores; then those in real time, by more workers: they mostly wait.
test: setup  ## set up, then run the tests; 6 minutes
	PYTEST='$(VENV)/bin/python -m pytest' WORKERS=$(WORKERS) tools/test.sh $(if $(MARKED),'$(MARKED)')

# What is marked `distro` is what a distro may change.
test-all: test-lowest  ## test so, with more examples, under each Python from 3.10 to 3.14, with each distro on PyPI; an hour
	$(MAKE) test HYPOTHESIS_PROFILE=thorough MARKED='not ros and not real_time'
	for distro in jazzy kilted; do for python in python3.10 python3.11 python3.12 python3.13 python3.14; do \
	    $$python -c '' 2>/dev/null || { echo "no $$python here: skipped"; continue; }; \
	    $(MAKE) test DISTRO=$$distro PYTHON=$$python VENV=.venv-$$distro-$$python \
	        MARKED=$$([ $$distro = jazzy ] || echo distro) || exit 1; \
	done; done

test-lowest:  ## test what needs no ROS with the oldest releases, under Python 3.10; 10 minutes
	@python3.10 tools/set_up.py --for=lowest .venv-lowest
	.venv-lowest/bin/python -m pytest -m 'not ros' test

check: setup  ## set up, then check style, types, who imports whom, workflows, and with Humble's linters; 1 minute
	$(VENV)/bin/ruff check
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports --no-cache --no-logo
	$(VENV)/bin/zizmor --offline --strict-collection .github
	@tools/check_humble_linters.sh $(python) .venv-humble-linters

floor: setup  ## drive a square on one simulated floor: as it is, calibrated, in a closed loop, past a person; 4 minutes
	rm -rf floor
	PATH="$(abspath $(VENV))/bin:$$PATH" examples/floor.sh floor

bench: setup  ## measure beside the lesson's loop: half an hour; QUICK=1: minutes
	$(VENV)/bin/python -m benchmarks $(if $(QUICK),--quick) $(if $(NO_BARS),--no-bars)

fleet-bench: setup  ## measure fleets of 1 to 200 robots; 15 minutes; QUICK=1: 2
	$(VENV)/bin/python -m benchmarks.fleet $(if $(QUICK),--quick) $(if $(NO_BARS),--no-bars)

stop-matrix: setup  ## let everything happen to a program that drives: 80 minutes; QUICK=1: minutes
	$(VENV)/bin/python -m benchmarks.stop_matrix $(if $(QUICK),--quick)

console-matrix: setup  ## let everything happen to the console and its browser: 40 minutes; QUICK=1: 2
	$(VENV)/bin/python -m benchmarks.console_matrix $(if $(QUICK),--quick)

mutants: setup  ## break the package on purpose, see that tests notice: 10 minutes; QUICK=1: pure ones, 2
	$(VENV)/bin/python tools/mutants/run.py --jobs 2 $(if $(QUICK),--pure)

colcon:  ## build, run and test the package as a ROS workspace does; 2 minutes
	$(SET_UP) --for=colcon $(VENV)-colcon
	tools/check_colcon.sh $(VENV)-colcon

# Sphinx uses a core for minutes and the documents mostly wait, so they run side by side.
docs:  ## build docs/ as a site in docs/_build, and do what it tells a reader to do; 5 minutes
	$(SET_UP) --for=colcon $(VENV)-colcon
	@PYTHONPATH=.$${PYTHONPATH:+:$$PYTHONPATH} nice -n 19 $(VENV)-colcon/bin/python -m sphinx \
	    -n -W --keep-going -q -b $(DOCS) -d docs/_build/doctrees docs docs/_build/$(DOCS) & site=$$!; trap "kill $$site" INT TERM; \
	$(VENV)-colcon/bin/python -m pytest -rs -n 4 --dist loadgroup test/test_docs.py; tests=$$?; \
	wait $$site || { echo 'docs: Sphinx has failed, see above' >&2; exit 1; }; exit $$tests

setup:  ## make the environment, if what it is made from has changed; seconds
	$(SET_UP) $(VENV)

# Debian names it one way, Ubuntu the other.
browser:  ## install Chromium for tests of pages, and what the console matrix uses (Debian and Ubuntu, as root); 1 minute
	$(AS_ROOT) apt-get update
	$(AS_ROOT) apt-get install --yes --no-install-recommends chromium chromium-driver || \
	    $(AS_ROOT) apt-get install --yes chromium-browser chromium-chromedriver
	$(AS_ROOT) apt-get install --yes --no-install-recommends xvfb openbox nftables

lock: setup  ## write requirements/*.txt anew, with the newest releases; 1 minute
	tools/lock.sh .venv-uv/bin/uv

clean:  ## remove all that the other targets made; a second
	rm -rf .venv .venv-* build *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	rm -rf docs/_build docs/reference/generated
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
