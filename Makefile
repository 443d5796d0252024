# make demo: set up, run the paper's experiment, show its results.   make test: set up, run the tests.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK = 1

.PHONY: demo test test-processes test-packaging test-slow test-mutation docs check lint format clean setup setup-dev setup-docs

$(VENV)/.setup: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] + ": set PYTHON=...") if sys.version_info < (3, 11) else None'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable .
	@echo "compiling the numeric kernels, once, in two processes"
	$(BIN)/python -m workbench.warmup
	touch $@

$(VENV)/.setup-dev: $(VENV)/.setup
	$(BIN)/pip install --quiet --editable '.[dev]'
	touch $@

$(VENV)/.setup-docs: $(VENV)/.setup-dev
	$(BIN)/pip install --quiet --editable '.[docs]'
	touch $@

setup: $(VENV)/.setup
setup-dev: $(VENV)/.setup-dev
setup-docs: $(VENV)/.setup-docs

demo: setup
	$(BIN)/perceptron-emu demo

test: setup-dev
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

test-processes: setup-dev
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -m "processes and not slow"

test-packaging: setup-dev
	$(if $(MATRIX),PACKAGING_MATRIX=1 )$(BIN)/python -m pytest -m packaging

test-mutation: setup-dev
	$(BIN)/pip install --quiet --editable '.[mutation]'
	$(BIN)/python benchmarks/mutants.py

test-slow: setup-dev
	$(BIN)/python -m pytest -m slow

docs: setup-docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs build/site
	$(BIN)/python -m pytest -n 2 -m tutorials
	@echo "open build/site/index.html"

check: setup-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --config-file benchmarks/mypy.ini
	$(BIN)/lint-imports --no-cache

format: setup-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	find . -path ./$(VENV) -prune -o \( -name "*.nbi" -o -name "*.nbc" \) -exec rm -f {} +
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
