# Two commands do everything: `make demo` and `make test`. Both set up .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
USED := $(VENV)/.used
STAMP := $(VENV)/.installed
# Modules are compiled when they are first imported: most never are.
PIP := PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile

DOCS := $(VENV)/.docs
WHEEL := build/wheel

# many short programs are started: compiled once, whatever the shell asks for
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test docs wheel lock lab lint types contracts crate-validator sbom release man clean

# What a user needs: the program and its reports.
$(USED): pyproject.toml constraints.txt
	@echo "Setting up $(VENV): numpy, Pinocchio, SciPy, Matplotlib ... (half a minute to two)"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) --constraint constraints.txt --editable '.[report]'
	@touch $@

# What tests and checks need besides.
$(STAMP): $(USED)
	@echo "Adding what the tests need to $(VENV) (half a minute to two) ..."
	@$(PIP) --upgrade 'pip>=25.1'
	@$(PIP) --constraint constraints.txt --editable '.[all]' --group test --group dev
	@touch $@

test: $(STAMP)  ## set up, then run every test of the default suite
	$(BIN)/python -m pytest -n 2 --dist loadfile

$(DOCS): $(STAMP) docs/constraints.txt
	@$(PIP) --constraint constraints.txt --constraint docs/constraints.txt --group docs
	@touch $@

docs: $(DOCS)  ## the documentation: docs/_build/html/index.html
	$(BIN)/python -m sphinx -W --keep-going -q docs docs/_build/html

demo: $(USED)  ## two simulated sessions of ten trials, then the report of both
	rm -rf demo
	@echo "Two simulated sessions side by side, ten trials each (one to three minutes);" \
	  "their logs: demo/*.log"
	@mkdir -p demo
	@$(BIN)/traction run S0 --fake --fast --data demo > demo/S0.log 2>&1 & first=$$!; \
	  $(BIN)/traction run TF --fake --fast --data demo > demo/TF.log 2>&1 & second=$$!; \
	  trap 'kill $$first $$second 2> /dev/null; exit 130' INT TERM; \
	  told=0; while kill -0 $$first 2> /dev/null || kill -0 $$second 2> /dev/null; do \
	    sleep 1; kept=$$(ls demo/sessions/*/trials/T??.json 2> /dev/null | wc -l); \
	    if [ $$kept -ge $$((told + 2)) ]; then echo "$$kept of 20 trials"; told=$$kept; fi; \
	  done; \
	  wait $$first || { cat demo/S0.log; exit 1; }; \
	  wait $$second || { cat demo/TF.log; exit 1; }
	$(BIN)/traction status --data demo
	$(BIN)/traction report --all --data demo

wheel: $(STAMP)  ## built below build/wheel; .ci/installs installs it and runs it
	rm -rf $(WHEEL) build/lib build/bdist.*
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps \
	    --wheel-dir $(WHEEL) .

lab: $(STAMP)  ## the program beside the real kernel's drivers, in an emulated machine
	$(BIN)/python -m lab

lint: $(STAMP)  ## ruff: lint and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)  ## pyright
	$(BIN)/pyright --pythonpath $(BIN)/python

contracts: $(STAMP)  ## who may import whom
	$(BIN)/lint-imports

crate-validator: .venv-crate/.installed  ## roc-validator, which needs an older rich

.venv-crate/.installed:
	$(PYTHON) -m venv .venv-crate
	.venv-crate/bin/python -m pip install --quiet --disable-pip-version-check \
	    roc-validator==0.13.0
	@touch $@

lock: $(STAMP)  ## pylock.toml and constraints.lock, of wheels for every Python that is declared
	$(BIN)/python -m tests.pylock

sbom: $(STAMP)  ## what is installed, as CycloneDX JSON: sbom.json
	$(BIN)/python -m tests.sbom > sbom.json

release: $(STAMP)  ## wheel, sdist, man pages, bill of materials, checksums: dist/
	.ci/release

man: $(STAMP)  ## manual pages of all commands: build/man
	$(BIN)/python docs/man_pages.py build/man

clean:
	rm -rf $(VENV) .venv-crate demo build dist sbom.json docs/_build docs/api docs/project *.egg-info
