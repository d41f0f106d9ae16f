# Two commands for a fresh machine: `make demo` and `make test`. The rest is for people who work on batten.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out/freeform-wall

.PHONY: demo test lint types layers unit bench refusal clean

demo: $(VENV)/.installed
	$(BIN)/batten cut examples/freeform-wall/wall.toml -o $(OUT)
	$(BIN)/batten simulate $(OUT)

refusal: $(VENV)/.installed
	$(BIN)/batten cut examples/freeform-wall/refused.toml -o out/refused

test: lint types layers unit

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

layers: $(VENV)/.dev
	$(BIN)/lint-imports

# One thread of linear algebra for each of the two processes: more only wait for one another.
unit: export OPENBLAS_NUM_THREADS := 1
unit: $(VENV)/.dev
	$(BIN)/pytest -n 2 -m "not slow"

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/run.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet -e .
	touch $@

$(VENV)/.dev: $(VENV)/.installed pyproject.toml
	$(BIN)/python -m pip install --quiet -e . --group dev
	touch $@

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
