# `make fly` and `make test` do everything from a clean clone, in .venv, with pinned versions.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready
ARGS ?=

.PHONY: help setup fly bench check test attack format figures picture clean

help:
	@echo "make fly     set up if needed and fly the default mission; ARGS='--task random-walk'"
	@echo "make test    set up if needed and run the tests"
	@echo "make attack  ten minutes of faults: full disks, kills, damaged files; tried and held"
	@echo "make check   formatter, linter and type checker"
	@echo "make bench   time the simulation on this machine"
	@echo "make figures remake the paper's figures; evaluates what training/results/ lacks"
	@echo "make picture remake the README's picture (needs a Vulkan driver)"
	@echo "make setup   create .venv from pinned constraints; PYTHON=python3.12 chooses another"
	@echo "make clean   remove .venv, replays and caches"

setup: $(READY)

$(READY): pyproject.toml tools/constraints.txt
	@$(PYTHON) -c "import sys; sys.exit(0 if sys.version_info >= (3, 11) else \
	  f'swarm_mj needs Python 3.11 or newer, not {sys.version.split()[0]}; try make PYTHON=python3.11')"
	@echo "Setting up .venv (a few minutes and 2.7 GB, once) ..."
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --constraint tools/constraints.txt --editable '.[dev]'
	@touch $@

fly: setup
	$(BIN)/swarm-mj fly $(ARGS)

bench: setup
	$(BIN)/swarm-mj bench $(ARGS)

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright

test: setup
	$(BIN)/python -m pytest --numprocesses 2 --dist loadscope --no-loadscope-reorder $(ARGS)

attack: setup
	SWARM_MJ_TRIES=20 $(BIN)/python -m pytest --numprocesses 2 tests/faults $(ARGS)

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

figures: setup
	$(BIN)/python training/paper_figures.py $(ARGS)
	for preset in reference paper; do \
	  $(BIN)/swarm-mj figures training/results/$$preset-*.csv --out assets/figures/$$preset --force \
	    || exit; \
	done

picture: setup
	$(BIN)/swarm-mj fly --record replays/readme.rrd --force
	$(BIN)/python tools/picture.py replays/readme.rrd --window 476 --size 1600x1066 --zoom 3 \
	  --out assets/pictures/replay.png

clean:
	rm -rf .venv replays build dist .pytest_cache .ruff_cache .hypothesis
	find swarm_mj tests tools training -name __pycache__ -type d -prune -exec rm -rf {} +
