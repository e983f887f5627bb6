PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
# Links to the folders under their import names, for tools that read source text.
LINKS := build/checked

.PHONY: press test test-all faults lint layers bench docs gallery clean links

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group dev
	touch $@

$(VENV)/peers: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group peers && touch $@ \
	  || echo "no peers: comparisons with them are skipped"

links:
	mkdir -p $(LINKS)/sautereau
	ln -sfn $(addprefix $(CURDIR)/,rig trajectory daq analysis sim_backend robot) \
	  $(CURDIR)/sautereau/* $(LINKS)/sautereau

press: $(VENV)/installed  ## three presses on the stand-in, compared with the model
	$(BIN)/sautereau press --sim -n 3 --out $(OUT)/press

test: lint
	$(BIN)/python -m pytest -q -n auto --dist worksteal

test-all: $(VENV)/peers lint
	$(BIN)/python -m pytest -q -m "slow or not slow"

faults: $(VENV)/installed  ## inject every fault, and write docs/faults.md
	SAUTEREAU_FAULTS=docs/faults.md $(BIN)/python -m pytest -q -m "slow or not slow" \
	  tests/robot/test_faults.py

lint: $(VENV)/installed links
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	@$(MAKE) --no-print-directory layers

layers: $(VENV)/installed links
	cd $(LINKS) && PYTHONPATH=. $(CURDIR)/$(BIN)/lint-imports --no-cache \
	  --config $(CURDIR)/pyproject.toml

bench: $(VENV)/peers
	$(BIN)/python -m benchmarks

docs: $(VENV)/installed links  ## the site, into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

gallery: $(VENV)/installed  ## redraw the README's picture; the site draws the others itself
	$(BIN)/python -m examples.gallery docs/gallery session.png

clean:
	rm -rf $(VENV) $(OUT) build site *.egg-info
