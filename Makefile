PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out

.PHONY: press test test-all faults lint bench docs gallery clean

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group dev
	touch $@

$(VENV)/peers: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group peers && touch $@ \
	  || echo "no peers: what compares with them is left out"

press: $(VENV)/installed  ## three presses on the stand-in, compared with the model
	$(BIN)/sautereau press --sim -n 3 --out $(OUT)/press

test: $(VENV)/installed
	$(BIN)/python -m pytest -q -n auto --dist worksteal

test-all: $(VENV)/peers
	$(BIN)/python -m pytest -q -m "slow or not slow"

faults: $(VENV)/installed  ## let every fault happen, and write docs/faults.md
	SAUTEREAU_FAULTS=docs/faults.md $(BIN)/python -m pytest -q -m "slow or not slow" \
	  tests/robot/test_thirty_faults.py

lint: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

bench: $(VENV)/peers
	$(BIN)/python -m benchmarks

docs: $(VENV)/installed  ## the site, into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

gallery: $(VENV)/installed  ## the README's picture anew; the site draws the others itself
	$(BIN)/python -m examples.gallery docs/gallery session.png

clean:
	rm -rf $(VENV) $(OUT) build site *.egg-info
