# `make fly` and `make test` do everything from a clean clone, in .venv, with pinned versions.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready
DEV := .venv/dev
HASHES := tools/hashes.txt tools/hashes-dev.txt
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
UV := $(BIN)/uv pip install --python $(BIN)/python --quiet
ARGS ?=
SCALE ?= paper
STUDIES ?=
BUDGET ?= quick

.PHONY: help setup setup-dev fly bench bench-peers check same test test-all test-engines test-installs attack reference lock audit format results leaderboard figures reproduce picture video docs docs-serve clean

help:
	@echo "make fly     set up if needed and fly the default mission; ARGS='--task random-walk'"
	@echo "make test    set up if needed and run the tests, each law once"
	@echo "make test-all  run the long tests, too: many seeds, a built wheel, the site"
	@echo "make test-engines  try studies on a Ray cluster and on SLURM's stand-in; installs 0.3 GB"
	@echo "make test-installs  try every install line of the docs; minutes, downloads much; ARGS='--only ray'"
	@echo "make attack  run the fault tests for minutes, and count what held"
	@echo "make reference  ask the network simulator ns-3 again (Linux on x86-64, with g++)"
	@echo "make check   formatter, linter and type checker"
	@echo "make same    prove that every flight and training is as before, to the last digit; ARGS='--against HEAD~1'"
	@echo "make format  let the formatter and the linter mend what they can"
	@echo "make bench   time the simulation on this machine"
	@echo "make bench-peers  time it beside MuJoCo alone, VMAS and the paper's authors' code; ARGS='--authors DIR'"
	@echo "make results fly every table and figure of the docs, at one commit: hours; SCALE=smoke takes minutes"
	@echo "make leaderboard  fly the benchmark and write training/leaderboard.md"
	@echo "make figures draw all figures from training/results/"
	@echo "make reproduce  train the paper's GNNs anew, then fly them; BUDGET=full has the authors' budget"
	@echo "make video   remake the moving pictures (needs OpenGL, or libosmesa6)"
	@echo "make picture remake the pictures of replays (needs a Vulkan driver)"
	@echo "make docs    build this documentation as a site; make docs-serve shows it while you write"
	@echo "make setup   create .venv from pinned wheels; PYTHON=python3.12 chooses another"
	@echo "make setup-dev  add what tests, checks and the documentation need"
	@echo "make lock    write tools/hashes*.txt anew from the pinned constraints"
	@echo "make audit   list the licences of what is installed, and its known vulnerabilities"
	@echo "make clean   remove .venv, replays and caches"

setup: $(READY)

setup-dev: $(DEV)

# Every wheel must have the hash it was tested with, but torch's, which differ from index to index: a
# CPU build on one, CUDA's gigabytes on another. uv installs in seconds what takes pip minutes; but
# pip alone knows an index that only pip's configuration names, so it is the way out, and brings torch.
hashed = $(UV) --no-deps --require-hashes --requirement $(1) || { echo "uv cannot; pip goes on ..."; \
  $(PIP) --no-deps --require-hashes --requirement $(1); }

$(READY): pyproject.toml tools/constraints.txt tools/hashes-uv.txt tools/hashes.txt
	@$(PYTHON) -c "import sys; sys.exit(0 if (3, 11) <= sys.version_info < (3, 13) else \
	  f'the pinned versions are for Python 3.11 and 3.12, not {sys.version.split()[0]}; ' \
	  'try make PYTHON=python3.11')"
	@echo "Setting up .venv (a minute, once; 2.4 GB, or 6 GB with CUDA) ..."
	@$(PYTHON) -m venv .venv
	@$(PIP) --no-deps --require-hashes --requirement tools/hashes-uv.txt
	@echo "  packages ..."
	@$(call hashed,tools/hashes.txt)
	@echo "  torch ..."
	@$(PIP) --constraint tools/constraints.txt torch
	@echo "  swarm_mj ..."
	@$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@
	@echo "Done. make fly flies a mission; after 'source .venv/bin/activate', swarm-mj --help says what else there is."

# What the tests, the checks and the documentation need on top.
$(DEV): $(READY) tools/hashes-dev.txt
	@echo "Adding what tests, checks and the documentation need ..."
	@$(call hashed,tools/hashes-dev.txt)
	@touch $@

fly: setup
	$(BIN)/swarm-mj fly $(ARGS)

bench: setup
	$(BIN)/swarm-mj bench $(ARGS)

bench-peers: setup .venv/peers/ready
	PYTHONPATH=. .venv/peers/bin/python tools/peers.py $(ARGS)

# VMAS is under the GPL and no dependency: it has an environment of its own, which sees all of .venv,
# so that torch is there once. gym, of VMAS, also serves the authors' code.
.venv/peers/ready: Makefile
	@echo "Installing VMAS in .venv/peers (41 MB) ..."
	@$(PYTHON) -m venv .venv/peers
	@$(BIN)/python -c "import sysconfig; print(sysconfig.get_path('purelib'))" > \
	  $$(.venv/peers/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/others.pth
	@.venv/peers/bin/python -m pip install --quiet --disable-pip-version-check vmas==1.5.2 gym==0.26.2
	@touch $@

check: $(DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright

same: setup
	$(BIN)/python tools/same.py $(ARGS)

# Tests of a module run in one process, which has its fixtures; both share numba's cache on disk. Tests
# start hundreds of processes, each of which would compile Python anew if its bytecode were not kept.
PYTEST := env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest --numprocesses 2 --dist loadscope --no-loadscope-reorder

test: $(DEV)
	$(PYTEST) -m "not slow" $(ARGS)

test-all: $(DEV)
	$(PYTEST) $(ARGS)

# Ray is large and few need it: it has an environment of its own, which sees all of .venv.
test-engines: $(DEV) .venv/engines/ready
	PYTHONPATH=. .venv/engines/bin/python -m pytest tests/evaluation/test_engines.py $(ARGS)

.venv/engines/ready: Makefile
	@$(PYTHON) -m venv .venv/engines
	@$(BIN)/python -c "import sysconfig; print(sysconfig.get_path('purelib'))" > \
	  $$(.venv/engines/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/others.pth
	@.venv/engines/bin/python -m pip install --quiet --disable-pip-version-check ray==2.60.0 submitit==1.5.4
	@touch $@

test-installs: $(DEV)
	$(BIN)/python tools/installs.py $(ARGS)

attack: $(DEV)
	SWARM_MJ_TRIES=20 SWARM_MJ_FAULTS=training/results/attack.csv \
	  $(BIN)/python -m pytest --numprocesses 2 tests/faults $(ARGS)

reference: setup .venv/ns3/ready
	$(BIN)/python training/reference/ns3.py $(ARGS)

# For its headers and libraries only; the Python interface, whose compiler takes half an hour to build, is
# left out, so any Python will do.
.venv/ns3/ready: Makefile
	@echo "Installing ns-3 in .venv/ns3 (320 MB) ..."
	@$(PIP) --target .venv/ns3 --upgrade --no-deps --only-binary :all: --python-version 3.11 \
	  --platform manylinux_2_28_x86_64 ns3==3.44.post0
	@touch $@

# What torch alone needs comes with it.
OF_TORCH := torch triton cuda-bindings cuda-pathfinder cuda-toolkit nvidia-cublas nvidia-cuda-cupti \
  nvidia-cuda-nvrtc nvidia-cuda-runtime nvidia-cudnn-cu13 nvidia-cufft nvidia-cufile nvidia-curand \
  nvidia-cusolver nvidia-cusparse nvidia-cusparselt-cu13 nvidia-nccl-cu13 nvidia-nvjitlink \
  nvidia-nvshmem-cu13 nvidia-nvtx

COMPILE := $(BIN)/uv pip compile --constraint tools/constraints.txt --universal --python-version 3.11 \
  --generate-hashes --no-annotate --no-header --quiet $(OF_TORCH:%=--no-emit-package %)

lock: setup
	echo uv | $(COMPILE) - --output-file tools/hashes-uv.txt
	printf 'hatchling\neditables\n' | $(COMPILE) pyproject.toml - --output-file tools/hashes.txt
	$(COMPILE) pyproject.toml --extra dev --output-file tools/hashes-dev.txt \
	  $$(sed -n 's/^\(.*\)==[^ ]* \\$$/--no-emit-package \1/p' tools/hashes.txt)

audit: $(DEV) .venv/audit/ready
	.venv/audit/bin/pip-licenses --python $(BIN)/python --order license
	@.venv/audit/bin/pip-audit --require-hashes --disable-pip --strict \
	  $(HASHES:%=--requirement %) || { echo "No complete audit: either this package index keeps no list of vulnerabilities," \
	  "or one is named above."; exit 1; }

.venv/audit/ready: Makefile
	@$(PYTHON) -m venv .venv/audit
	@.venv/audit/bin/python -m pip install --quiet --disable-pip-version-check \
	  pip-audit==2.10.1 pip-licenses==5.5.5
	@touch $@

format: $(DEV)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The paper's methods with two of ours, and ours with the paper's simplest.
PAPERS := random-flooding round-robin mst tdma planner GNN "linear GNN" "GNN on turns" "linear GNN on turns" \
  "one GNN" "GNN generalized from 0.25" "GNN trained at each size" "GNN generalized from 40" \
  "GNN trained on AoI" "GNN trained on velocity variance"
OURS := planner "planner --payload none" sotdma index-csma age-gain-csma gnn spatial-tdma tdma gossip csma aloha random-flooding \
  greedy-oracle lookahead-oracle

# STUDIES="city channels" flies these tables only; an interrupted run continues.
results: setup
	$(BIN)/python training/results.py --scale $(SCALE) $(if $(STUDIES),--studies $(STUDIES)) $(ARGS)
ifneq ($(STUDIES),)
	@echo "These tables are there. make results flies what is missing, then fills the docs and draws the figures."
else ifeq ($(SCALE),smoke)
	$(BIN)/python tools/results_table.py --structure --results runs/smoke
else
	$(BIN)/python tools/results_table.py
	$(MAKE) figures
endif

leaderboard: setup
	$(BIN)/python tools/leaderboard.py

figures: setup
	$(BIN)/swarm-mj figures training/results/reference-*.csv --out assets/figures/reference --force
	for name in fig2 fig3 fig4 fig5 fig6; do \
	  $(BIN)/swarm-mj figures \
	    $$(ls training/results/reproduce/$(BUDGET)/$$name.csv 2>/dev/null) \
	    $$(test $$name = fig3 -a -e training/results/reproduce/$(BUDGET)/fig3.csv || \
	      ls training/results/paper-*.csv) \
	    $$(test $$name = fig3 || ls training/results/reproduce/$(BUDGET)/one.csv 2>/dev/null) \
	    --figure $$name --policy $(PAPERS) --out assets/figures/paper --force || exit; \
	done
	$(BIN)/swarm-mj figures training/results/paper-*.csv \
	  --figure fig5 fig6 --policy $(OURS) \
	  --out assets/figures/policies --force
	$(BIN)/python training/convergence_figure.py
	$(BIN)/python training/limits_figure.py
	$(BIN)/python training/impairments_figure.py
	$(BIN)/python training/readme_figure.py
	$(BIN)/python training/large_teams_figure.py
	$(BIN)/python training/rewards_figure.py
	$(BIN)/python training/crashes_figure.py
	$(BIN)/python tools/diagrams.py

reproduce: setup
	$(BIN)/python training/reproduce.py --scale $(BUDGET) --force $(ARGS)

picture: setup
	$(BIN)/swarm-mj fly --record replays/readme.rrd --force
	$(BIN)/python tools/picture.py replays/readme.rrd --window 476 --size 1600x1066 --zoom 3 \
	  --out assets/pictures/replay.png --force
	$(BIN)/swarm-mj fly --preset urban --robots 20 --seed 3 --record replays/city.rrd --force
	$(BIN)/python tools/picture.py replays/city.rrd --window 380 --size 1600x1066 --zoom 3 \
	  --out assets/pictures/city.png --force

# Material's own notice about a coming version of MkDocs would be the only warning.
docs docs-serve: export NO_MKDOCS_2_WARNING = 1
docs: $(DEV)
	@echo "Building the site; it runs the tour, a minute or two ..."
	$(BIN)/mkdocs build --strict --quiet $(ARGS)
	@echo "site/index.html"

docs-serve: $(DEV)
	$(BIN)/mkdocs serve $(ARGS)

# The film at the top of the README, for dark and for light pages; and the default flight.
TOUR := --controller training.examples.city_tour:Tour --task random-walk --arena blocks --robots 30 \
  --range-ratio 0.15 --velocity-ratio 0.8 --windows 600 --force
video: setup
	$(BIN)/swarm-mj fly $(TOUR) --policy age-gain-csma --record replays/tour.rrd
	$(BIN)/swarm-mj fly $(TOUR) --policy random-flooding --record replays/tour-flooding.rrd
	for theme in dark light; do \
	  $(BIN)/swarm-mj replay replays/tour.rrd replays/tour-flooding.rrd --theme $$theme --seconds 15 \
	    --size 830x560 --video assets/pictures/tour-$$theme.gif --force || exit; \
	done
	$(BIN)/swarm-mj fly --record replays/planner.rrd --force
	$(BIN)/swarm-mj fly --policy random-flooding --record replays/random-flooding.rrd --force
	$(BIN)/swarm-mj replay replays/planner.rrd replays/random-flooding.rrd \
	  --video assets/pictures/flight.gif --force

clean:
	rm -rf .venv replays build dist site .pytest_cache .ruff_cache .hypothesis
	find swarm_mj tests tools training -name __pycache__ -type d -prune -exec rm -rf {} +
