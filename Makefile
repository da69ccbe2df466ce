PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: demo test lint bench fuzz study docs clean

demo: $(INSTALLED)  ## simulate a faulty actuator, diagnose it, write demo/report.html
	$(BIN)/emaphm demo --force

test: $(INSTALLED)  ## run the tests
	$(BIN)/python -m pytest -n auto

lint: $(INSTALLED)  ## check style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(INSTALLED)  ## measure speed, as ratios to the manoeuvre's own time
	$(BIN)/python -m pytest bench -p no:xdist --benchmark-columns=min,median,rounds

fuzz: $(INSTALLED)  ## spoil inputs of every kind for ten minutes
	$(BIN)/python -m tests.fuzz --minutes 10

study: $(INSTALLED)  ## measure accuracy and its limits, redo the thesis's comparison, write their pages in docs/
	$(BIN)/python -m bench.accuracy docs/accuracy.md
	$(BIN)/python -m bench.limits docs/limits.md
	$(BIN)/python -m bench.comparison docs/comparison

docs: $(INSTALLED)  ## draw the figures of the README and the examples
	$(BIN)/emaphm demo --out docs/demo --force
	$(BIN)/python examples/emps/emps.py --figure docs/emps.svg

clean:  ## remove what the other targets made
	rm -rf $(VENV) demo studies

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[dev]"
	touch $@
