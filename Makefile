PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
# Exact versions of the environment; `make CONSTRAINTS=/dev/null test` takes the newest allowed ones.
CONSTRAINTS ?= tests/constraints.txt
# Links to the folders under their import names, for tools that read source text.
LINKS := build/checked

.PHONY: press test test-all fuzz kills faults lint style layers bench docs gallery clean links lock bounds audit sbom dist

$(VENV)/installed: pyproject.toml $(wildcard $(CONSTRAINTS))
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[all]" --group dev
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

# The exact engine, compiled once beside the style (15 s of one processor): each process of the tests
# would compile it by itself.
$(VENV)/compiled: $(VENV)/installed $(wildcard sim_backend/physics/exact/*.py)
	$(BIN)/python -c "from sautereau.rig.load import load_rig; \
	  from sautereau.sim_backend.physics.observation import observe; \
	  from sautereau.sim_backend.scene import load_scene; observe(load_rig(), load_scene('pluck'))"
	touch $@

test test-all: export PYTHONDONTWRITEBYTECODE =  # dozens of processes import the same modules
test: $(VENV)/installed
	@$(MAKE) --no-print-directory -j 2 style $(VENV)/compiled
	$(BIN)/python -m pytest -q -n auto --dist worksteal

test-all: $(VENV)/peers $(VENV)/compiled lint
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m "slow or not slow"

fuzz: $(VENV)/installed  ## an hour of hostile input to every format and protocol, counted
	$(BIN)/python -m tests.fuzz --seconds 3600

kills: $(VENV)/installed  ## kill every command that writes at random moments, and cut its power
	$(BIN)/python -m tests.kills

faults: $(VENV)/installed  ## inject every fault, and write docs/faults.md
	SAUTEREAU_FAULTS=docs/faults.md $(BIN)/python -m pytest -q -m "slow or not slow" \
	  tests/robot/test_faults.py

style: $(VENV)/installed links  ## what takes a second; the types take a minute, in `make lint`
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@$(MAKE) --no-print-directory layers

lint: style
	$(BIN)/pyright

layers: $(VENV)/installed links
	cd $(LINKS) && PYTHONPATH=. $(CURDIR)/$(BIN)/lint-imports --no-cache \
	  --config $(CURDIR)/pyproject.toml

bench: $(VENV)/peers
	$(BIN)/python -m benchmarks

docs: $(VENV)/installed links  ## the site, into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

gallery: $(VENV)/installed  ## redraw the README's picture; the site draws the others itself
	$(BIN)/python -m examples.gallery docs/gallery session.png

lock: $(VENV)/installed  ## the versions of this environment, into tests/constraints.txt
	$(BIN)/python -m pip freeze --all --exclude-editable > tests/constraints.txt

$(VENV)/release: $(VENV)/installed
	$(PYTHON) -m venv $(VENV)/tools
	$(VENV)/tools/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	$(VENV)/tools/bin/python -m pip install --quiet --group release
	touch $@

bounds: $(VENV)/release links  ## the quick tests with the oldest and newest versions allowed
	$(VENV)/tools/bin/python -m tests.bounds $(ONLY)

audit: $(VENV)/release  ## consistency, without a network; then known vulnerabilities, with one
	$(BIN)/python -m pip check
	$(VENV)/tools/bin/pip-audit --strict --no-deps --disable-pip -r tests/constraints.txt || { echo "audit:\
	 where no vulnerability is listed, it was NOT checked: that needs pypi.org" >&2; exit 1; }

sbom: $(VENV)/release  ## what is installed, as CycloneDX, into build/sbom.json
	mkdir -p build
	$(VENV)/tools/bin/cyclonedx-py environment --output-reproducible --pyproject pyproject.toml \
	  -o build/sbom.json $(BIN)/python

dist: $(VENV)/installed  ## the wheel, the same bytes from the same commit, and its checksum
	rm -rf build/lib dist  # of earlier commits, whose files would be in the wheel
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m pip wheel --quiet --no-deps \
	  --no-build-isolation --wheel-dir dist .
	cd dist && sha256sum *.whl > SHA256SUMS

clean:
	rm -rf $(VENV) $(OUT) build site *.egg-info
