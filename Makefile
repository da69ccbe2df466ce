PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DOCUMENTING := $(VENV)/.documenting

.PHONY: demo test evidence lint bench fuzz study docs figures clean

demo: $(INSTALLED)  ## simulate a faulty actuator, diagnose it, write demo/report.html
	$(BIN)/emaphm demo --force

# Bytecode is kept, also where the environment says otherwise: the tests start many processes. Files are handed
# out in the order of tests/conftest.py: by the number of their tests, the longest of few tests would come last.
TESTS := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto \
	--dist loadfile --no-loadscope-reorder

test: $(INSTALLED)  ## run the tests that take seconds at most
	$(TESTS)

evidence: $(INSTALLED)  ## run the long tests: more cases by whole diagnoses, calibrations and searches
	$(TESTS) -m evidence

lint: $(INSTALLED)  ## check style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(INSTALLED)  ## measure speed, as ratios to the manoeuvre's own time
	$(BIN)/python -m pytest bench -p no:xdist --benchmark-columns=min,median,rounds

fuzz: $(INSTALLED)  ## spoil inputs of every kind for ten minutes
	$(BIN)/python -m tests.fuzz --minutes 10

STUDIES := accuracy limits plants loads data_sheets pmsm six_step thesis forms monitor hybrids

study: evidence  ## run the long tests and what is missing of the studies in studies/, write their pages in docs/
	for plan in $(STUDIES); do $(BIN)/emaphm study run $$plan --out studies/$$plan || exit 1; done
	$(BIN)/emaphm study report studies/accuracy --out docs --force
	$(BIN)/emaphm study report studies/limits --out docs --force
	$(BIN)/emaphm study report studies/plants --out docs --force
	$(BIN)/emaphm study report studies/loads --out docs --force
	$(BIN)/emaphm study report studies/data_sheets --out docs --force
	$(BIN)/emaphm study report studies/pmsm --out docs --force
	$(BIN)/emaphm study report studies/six_step --out docs --force
	$(BIN)/python -m emaphm.report.comparison_page studies docs/comparison
	$(BIN)/python -m emaphm.study.spoilt studies/spoilt
	$(BIN)/python -m emaphm.report.spoilt_page studies/spoilt docs
	$(BIN)/python -m emaphm.study.fleet studies/fleet
	$(BIN)/python -m emaphm.report.fleet.page studies/fleet docs

docs: $(DOCUMENTING)  ## build the site in docs/_build/html; every example of it is run
	rm -rf docs/_build docs/_tutorials docs/reference/generated
	OMP_NUM_THREADS=1 $(BIN)/sphinx-build -W --keep-going -q docs docs/_build/html

figures: $(INSTALLED)  ## draw the figures of the README and the examples
	$(BIN)/emaphm demo --out docs/demo --force
	$(BIN)/python examples/emps/emps.py --figure docs/emps.svg
	$(BIN)/python examples/xl330/xl330.py --figure docs/xl330.svg
	$(BIN)/python examples/pmsm/pmsm.py --figure docs/pmsm.svg
	$(BIN)/python examples/reprise/reprise.py --figure docs/reprise.svg > /dev/null
	$(BIN)/python examples/xjtu/xjtu.py --figure docs/xjtu.svg > /dev/null

clean:  ## remove what the other targets made
	rm -rf $(VENV) demo studies fuzz docs/_build docs/_tutorials docs/reference/generated

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[dev]"
	touch $@

$(DOCUMENTING): $(INSTALLED)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[dev,docs]"
	touch $@
