# Two commands for newcomers: `make demo` and `make test`. Both set up .venv first if need be.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
HOME_DIR ?= lmtr-home

# Numeric libraries in a worker process must not fight over the cores.
export OMP_NUM_THREADS ?= 1
export RAY_USAGE_STATS_ENABLED := 0
export MLFLOW_DISABLE_TELEMETRY := true
export DO_NOT_TRACK := true

# Of `make cluster`: its name, if there are several; containers that solve, and processors of each
# (by default two workers, and all of the machine divided among them); whether the lake lies in
# object storage (1, or 0 for no longer).
NAME =
WORKERS =
WORKER_CPUS =
STORAGE =
CLUSTER := $(PYTHON) docker/cluster.py
CLUSTER_NAME = $(if $(NAME),--name $(NAME))
CLUSTER_OPTIONS = $(CLUSTER_NAME) $(if $(WORKERS),--workers $(WORKERS)) \
	$(if $(WORKER_CPUS),--cpus $(WORKER_CPUS)) \
	$(if $(STORAGE),$(if $(filter 0 no false off,$(STORAGE)),--no-storage,--storage))

.PHONY: help python install demo test lint types test-fast test-slow format clean images cluster \
	cluster-down test-cluster

help:  ## Show the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: $(STAMP)  ## Create .venv and install the project with pinned versions

python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "make: Python 3.11 or newer is needed; name one with PYTHON=python3.11"; exit 1; }

$(STAMP): pyproject.toml constraints.txt | python
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "make: Python's venv is missing; install it, e.g. apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $(STAMP)

demo: install  ## Everything once, small: expert data, models, rollouts, report
	$(BIN)/lmtr --home $(HOME_DIR) run demo

test: lint types test-fast  ## Lint, types and the fast tests

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	@if command -v hadolint >/dev/null; then hadolint docker/Dockerfile; \
	elif [ -x $(BIN)/hadolint ]; then $(BIN)/hadolint docker/Dockerfile; \
	else echo "lint: no hadolint, the Dockerfile is not checked"; fi
	@if command -v docker-compose >/dev/null || docker compose version >/dev/null 2>&1; \
	then $(CLUSTER) config; else echo "lint: no Compose, its files are not checked"; fi

types: install
	$(BIN)/mypy

test-fast: install
	$(BIN)/pytest -m "not slow" -n 2 --dist loadfile --durations=15

test-slow: install  ## The tests that take minutes
	$(BIN)/pytest -m "slow and not cluster" --durations=15

test-cluster: install  ## The tests of clusters: a Ray head, containers where Docker is, SLURM where it is
	$(BIN)/pytest -m cluster -rs -s --durations=15

images: python  ## Build the images of the cluster
	$(CLUSTER) images

cluster: python  ## Start a cluster of containers on this machine: NAME= WORKERS= WORKER_CPUS= STORAGE=
	$(CLUSTER) up $(CLUSTER_OPTIONS)

cluster-down: python  ## Stop it; data stay in its volumes
	$(CLUSTER) down $(CLUSTER_NAME)

format: install  ## Format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:  ## Remove the environment and caches, never a home with data
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
