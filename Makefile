# make demo      run the example and say where its report is
# make test      run the tests
# make check     tests, lint, format check and type check
#
# Everything is installed into .venv, once; it is brought up to date when pyproject.toml changes.
# Another interpreter: make PYTHON=python3.12 demo

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip --disable-pip-version-check install --quiet

.PHONY: demo test lint format format-check types check clean

demo: $(VENV)/.installed
	$(BIN)/tensctl run examples/shell_3_1.toml -o out/shell_3_1
	@echo "report:  $(CURDIR)/out/shell_3_1/report.html"

test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -q -n 2

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .

format: $(VENV)/.installed-test
	$(BIN)/ruff format .

format-check: $(VENV)/.installed-test
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-test
	$(BIN)/pyright --pythonpath $(BIN)/python

check: test lint format-check types

clean:
	rm -rf $(VENV) out .pytest_cache .ruff_cache .hypothesis

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "tensctl needs Python 3.11 or newer; try make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	@echo "installing tensctl and what it needs into $(VENV); the first time takes some minutes"
	$(PIP) --editable .
	@touch $@

$(VENV)/.installed-test: pyproject.toml | $(VENV)/.installed
	@echo "installing what the tests need into $(VENV)"
	$(PIP) --editable '.[test]'
	@touch $@
