# make demo and make test each set up what they need on a fresh machine; see make help.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
UV     := $(shell command -v uv 2>/dev/null)

# One core per worker: small matrices lose more to threads than they gain.
export OPENBLAS_NUM_THREADS ?= 1

# Bytecode is kept, or every process that is started compiles the code anew.
export PYTHONDONTWRITEBYTECODE =

PYTEST := $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow check format docs bench bench-quick fuzz lock clean

help:  ## show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 13

demo: $(VENV)/.core  ## set up and run the main job on a simulated log
	$(BIN)/agonic demo -o demo

test: $(VENV)/.dev  ## set up and run the tests
	$(PYTEST) -m "not slow"

test-slow: $(VENV)/.dev  ## run the tests of many draws and whole campaigns
	$(PYTEST) -m slow

check: $(VENV)/.dev  ## lint, types, layers, formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

format: $(VENV)/.dev  ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.dev  ## build the documentation into docs/_build
	$(BIN)/sphinx-build -W -q docs docs/_build

bench: .venv-bench/.bench .venv-peers/.peers  ## regenerate benchmarks/results; FULL=1 the larger studies, PARTS="speed field" some
	.venv-bench/bin/python -m benchmarks.run $(PARTS) $(if $(FULL),--full)

bench-quick: $(VENV)/.dev  ## name what became slower than the kept ratios, in two minutes
	$(BIN)/python -m benchmarks.ratios --compare

MINUTES ?= 2
fuzz: $(VENV)/.dev  ## damage and extreme values against readers and commands, MINUTES=2 or TRIES=600
	$(BIN)/python -m benchmarks.fuzz --minutes $(MINUTES) $(if $(TRIES),--tries $(TRIES)) $(if $(FIRST),--first $(FIRST))

lock: $(VENV)/.dev  ## write the hashed lock files anew
	$(BIN)/python -m pip install -q uv
	for part in core:"" dev:"--extra dev" bench:"--extra bench" peers:"--extra peers"; do \
	  $(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes \
	    --no-emit-index-url --no-header $${part#*:} pyproject.toml lock/build.in \
	    -o lock/$${part%%:*}.txt; done

clean:  ## remove what make made
	rm -rf .venv .venv-bench .venv-peers docs/_build demo

# $(call install,folder of the environment,lock file); the code is compiled at once, or where bytecode
# is not kept (PYTHONDONTWRITEBYTECODE) every command compiles it anew.
ifdef UV
install = $(UV) venv -q --allow-existing --python $(PYTHON) $(1) \
  && $(UV) pip install -q --python $(1)/bin/python --require-hashes -r $(2) \
  && $(UV) pip install -q --python $(1)/bin/python --no-deps --no-build-isolation -e . \
  && $(1)/bin/python -m compileall -q src
else
install = $(PYTHON) -m venv $(1) \
  && $(1)/bin/python -m pip install -q --disable-pip-version-check --require-hashes -r $(2) \
  && $(1)/bin/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e . \
  && $(1)/bin/python -m compileall -q src
endif

$(VENV)/.core: lock/core.txt pyproject.toml
	$(call install,$(VENV),lock/core.txt)
	@touch $@

$(VENV)/.dev: lock/dev.txt pyproject.toml
	$(call install,$(VENV),lock/dev.txt)
	@touch $@ $(VENV)/.core

.venv-bench/.bench: lock/bench.txt pyproject.toml
	$(call install,.venv-bench,lock/bench.txt)
	@touch $@

.venv-peers/.peers: lock/peers.txt pyproject.toml
	$(call install,.venv-peers,lock/peers.txt)
	@touch $@
