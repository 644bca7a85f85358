# Two commands for newcomers: `make demo` and `make test`. Each installs what it needs first.

SHELL := /bin/bash
BIN := .venv/bin
# A file's tests stay together: they share what is costly to make.
SPREAD := -n auto --maxprocesses 4 --dist loadfile
UV_COMPILE := $(BIN)/uv pip compile pyproject.toml --universal --fork-strategy fewest \
	--python-version 3.11 --no-header --generate-hashes -q

.PHONY: help demo learn test test-models install install-dev lint types fast sim docs format lock clean

help: ## What can be made
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:.*## /\t/' | expand -t 14

demo: install ## Install what is missing, then evaluate a policy server end to end
	$(BIN)/robospa demo

test: install-dev ## Install what is missing, then lint, types, fast tests, simulator tests
	@$(MAKE) --no-print-directory --keep-going lint types fast sim

install: ## .venv, packages, robospa itself, a Vulkan driver: only what is missing
	@bash scripts/setup.sh

install-dev: ## The same with the test tools
	@bash scripts/setup.sh --dev

lint: ## ruff: rules and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: ## mypy --strict over the installed packages
	$(BIN)/mypy -p robospa

fast: ## Tests without simulator
	$(BIN)/pytest $(SPREAD)

sim: ## Tests that run the simulator
	$(BIN)/pytest -m sim $(SPREAD)

learn: install ## Train the learned reference anew, in runs/learned (needs torch; a night of two cores)
	$(BIN)/robospa learn

test-models: install-dev ## LeRobot: tiny policies served, data sets loaded; in .venv-models (Python 3.12)
	@[ -n "$$ROBOSPA_MODELS_PYTHON" ] || bash scripts/models.sh
	$(BIN)/pytest tests/models -m models

docs: ## The documentation's pages with the API reference, in build/docs; a warning is an error
	[ -x .venv-docs/bin/pip ] || python3 -m venv .venv-docs
	.venv-docs/bin/pip install -q --disable-pip-version-check "zensical>=0.0.70" "mkdocstrings-python>=2"
	.venv-docs/bin/zensical build --strict

format: ## Let ruff format and sort
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: ## Renew both lock files from pyproject.toml (LOCK=--upgrade for newer versions)
	$(BIN)/pip install -q uv
	$(UV_COMPILE) $(LOCK) --extra sim --extra report --extra demos -o requirements.lock
	$(UV_COMPILE) $(LOCK) --extra sim --extra report --extra demos --extra dev \
		-c requirements.lock \
		-o requirements-dev.lock

clean: ## Forget the environment, caches and build output; runs/ stays
	rm -rf .venv .venv-models .venv-peers .venv-docs build .mypy_cache .ruff_cache .pytest_cache .hypothesis
