# Every target sets up .venv by itself; nothing is installed again until pyproject.toml or constraints.txt changes.
PYTHON ?= python3
ARGS ?=
BIN := .venv/bin
INSTALL = $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help demo test lint format bench train clean distclean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo 'Options: PYTHON=python3.12 (when .venv is made), ARGS="..." (for demo, bench and train)'

demo: .venv/.demo  ## Steer the rod's tip around a circle
	$(BIN)/python -m scripts.demo $(ARGS)

train: .venv/.demo  ## Train the PPO agent
	$(BIN)/python -m scripts.train_ppo $(ARGS)

bench: .venv/.demo  ## Measure simulation speed
	$(BIN)/python -m scripts.bench $(ARGS)

test: lint  ## Lint, check types and run every test
	$(BIN)/python -m pytest -n 2 --dist worksteal

lint: .venv/.test  ## Check style, format and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: .venv/.test  ## Fix style and format
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean:  ## Remove caches and build outputs
	rm -rf build dist .pytest_cache .ruff_cache .mypy_cache
	find . -name .venv -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean  ## As clean, and remove .venv
	rm -rf .venv

.venv/bin/pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	  { echo "error: Python 3.10 or newer is needed; name one with PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -m venv .venv || \
	  { echo "error: $(PYTHON) could not make .venv: install its venv package (Debian, Ubuntu: python3-venv)," \
	    "remove a .venv made by another Python (make distclean), or name another with PYTHON=..." >&2; exit 1; }

.venv/.demo: pyproject.toml constraints.txt | .venv/bin/pip
	$(INSTALL) -e '.[rl,viz]'
	@touch $@

.venv/.test: pyproject.toml constraints.txt | .venv/bin/pip
	$(INSTALL) -e '.[rl,viz,test,dev]'
	@touch $@
