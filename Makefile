# Everything runs in .venv, which is made on first use; no virtual environment need be active.
# PYTHONPATH and AMENT_PREFIX_PATH of a sourced ROS installation are kept out, and PYTHONDONTWRITEBYTECODE, with which
# every program started would compile all its modules anew (5 s of processor time a node).
SHELL := /bin/bash
VENV := .venv
READY := $(VENV)/.ready
PATHS := PATH="$(CURDIR)/$(VENV)/bin:$$PATH"
RUN := env -u PYTHONPATH -u PYTHONHOME -u PYTHONDONTWRITEBYTECODE $(PATHS) AMENT_PREFIX_PATH="$(CURDIR)/$(VENV)"
COLCON := env -u PYTHONPATH -u PYTHONHOME -u AMENT_PREFIX_PATH $(PATHS) COLCON_DEFAULTS_FILE=colcon_defaults.yaml colcon
ARGS ?=
SEED := $(or $(SEED),$(shell date +%s))

ifndef GBAS_DATA
ifneq ($(wildcard ../shared/data),)
export GBAS_DATA := $(abspath ../shared/data)
endif
endif

.PHONY: help setup demo test campaign bag lint build packages clean lock
.DEFAULT_GOAL := help

help:  ## what can be made
	@awk -F':.*## ' '/^[a-z]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(READY): constraints.txt scripts/setup.sh $(wildcard src/*/setup.py)
	@scripts/setup.sh $(VENV)
	@touch $@

setup: $(READY)  ## make .venv with the suite and everything it needs

demo: $(READY)  ## fly one approach, write a bag and a report, print where they are
	@$(RUN) gbas demo $(ARGS)

test: $(READY)  ## run every test but the campaigns (ARGS="-k name" to choose)
	@$(RUN) python -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(ARGS)

campaign: $(READY)  ## run the long tests, and look for new examples (SEED=n repeats a run)
	@echo "seed of the examples: $(SEED); again with: make campaign SEED=$(SEED)"
	@$(RUN) python -m pytest -m "campaign or hypothesis" --hypothesis-profile explore --hypothesis-seed $(SEED) $(ARGS)

bag: $(READY)  ## record the repository's bag anew (bags/README.md says when)
	rm -rf out/short
	@$(RUN) gbas demo --config short_approach --out out/short
	@$(RUN) gbas bag check out/short/bag
	rm -rf bags/short_approach
	cp -r out/short/bag bags/short_approach

lint: $(READY)  ## ruff, and mypy --strict on the pure modules
	@$(RUN) ruff check .
	@$(RUN) mypy

build: $(READY)  ## colcon build of the ROS 2 workspace
	@cd ros2_ws && $(COLCON) build

packages: $(READY)  ## list the packages as colcon sees them
	@cd ros2_ws && $(COLCON) list

clean:  ## remove .venv and all that was built
	rm -rf $(VENV) ros2_ws/build ros2_ws/install ros2_ws/log src/*/build src/*/*.egg-info
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

lock: $(READY)  ## pin requirements.txt and all it needs in constraints.txt
	@head -2 constraints.txt > $(VENV)/constraints.new
	@$(VENV)/bin/uv pip compile -q --system-certs --no-annotate --no-header --python-version 3.11 requirements.txt >> $(VENV)/constraints.new
	@mv $(VENV)/constraints.new constraints.txt
