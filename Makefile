# Two commands: `make demo` and `make test`.  Both do all the set-up first.
#
#   PYTHON   interpreter for the environment            (python3.11, else python3)
#   VENV     where the environment lies                 (.venv)
#   INDEX    an additional package index, by address.   On a machine without a GPU give PyTorch's
#            index of CPU builds here, and no CUDA libraries are downloaded.
#   DEMO     folder of the demo's samples and run       (runs/demo)
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
INDEX ?=
DEMO ?= runs/demo
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-slow lint types docs clean

help: ## what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

$(VENV)/.ready: pyproject.toml .ci/constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet $(if $(INDEX),--extra-index-url $(INDEX)) -c .ci/constraints.txt -e '.[test]'
	touch $@

setup: $(VENV)/.ready ## the environment, with pinned versions

demo: $(VENV)/.ready ## the main job on the embedded samples: table and report page
	$(BIN)/pnabs samples $(DEMO)/samples
	$(BIN)/pnabs run jobs/demo.yaml --set dataset.root=$(abspath $(DEMO))/samples --out $(DEMO)/run

test: $(VENV)/.ready ## the test suite
	$(BIN)/pytest -m "not slow"

test-slow: $(VENV)/.ready ## the tests that take minutes
	$(BIN)/pytest -m slow -o faulthandler_timeout=1800

lint: $(VENV)/.ready ## style and one-way imports
	$(BIN)/ruff check pnabs tests benchmarks docs/reference.py
	$(BIN)/ruff format --check pnabs tests benchmarks docs/reference.py
	$(BIN)/lint-imports

types: $(VENV)/.ready ## static types
	$(BIN)/mypy

docs: $(VENV)/.ready ## the documentation, into build/docs
	$(BIN)/pip install --quiet $(if $(INDEX),--extra-index-url $(INDEX)) -c .ci/constraints.txt -e '.[docs]'
	$(BIN)/mkdocs build --strict --config-file docs/mkdocs.yml

clean: ## the environment and the demo's folder
	rm -rf $(VENV) $(DEMO)
