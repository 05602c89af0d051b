# Two commands do everything: `make demo` and `make test`. Each makes its own .venv and installs what it needs: the demo
# what the program runs with, the tests the tools of development as well.
# Another interpreter: make PYTHON=python3.12 test. The demo's wheel again: make demo SEED=7

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
RUNTIME := $(VENV)/.runtime
INSTALLED := $(VENV)/.installed

.PHONY: help demo docs test check lint quick-tests all-tests proof-measured install clean

help:
	@echo "make demo     a simulated wheel behind a real tty, its log, what the model lacks, the proof, and a table held by it; four minutes"
	@echo "make docs     the documentation as a site that reads without a network: build/site/index.html"
	@echo "make test     lint, types, import contracts and all tests, as CI runs them"
	@echo "make check    the same without the slow tests"
	@echo "make proof-measured  the diagnosis of the measured records in ../shared/data beside three rivals; skipped without them"
	@echo "make install  .venv with everything; then: source $(BIN)/activate && rw-ekf --help"
	@echo "make clean    remove .venv and caches"

$(RUNTIME): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.11, 3.12 or 3.13 is needed; name one: make PYTHON=/path/to/python3.12 test"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || \
		{ echo "$(PYTHON) is not Python 3.11, 3.12 or 3.13"; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e .
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m tools.write_bytecode
	@touch $@

$(INSTALLED): $(RUNTIME)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e '.[dev]'
	@$(BIN)/python -m compileall -q -j 0 $(VENV)/lib rw_ekf drivers tools || true  # some packages carry files of no Python
	@touch $@

install: $(INSTALLED)

demo: $(RUNTIME)
	@$(BIN)/python -m tools.demo $(if $(SEED),--seed $(SEED))

# The site, into build/site; the tests build it too, with its notebooks run and every warning an error.
docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --config-file tools/site/mkdocs.yml
	@echo "build/site/index.html"

# Lint runs beside the tests, and the tests in a few processes more than there are cores, for many wait (tests/conftest.py);
# those marked xdist_group share one.
check: $(INSTALLED)
	@$(MAKE) --no-print-directory -j2 lint quick-tests

test: $(INSTALLED)
	@$(MAKE) --no-print-directory -j2 lint all-tests

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

quick-tests:
	$(BIN)/pytest -n auto --dist loadgroup -m "not slow"

all-tests:
	$(BIN)/pytest -n auto --dist loadgroup --durations=25

# Records of machines, which are no part of the project: DATA=/other/folder names where they are.
proof-measured: $(INSTALLED)
	@$(BIN)/python -m tools.proof.measured --data $(or $(DATA),../shared/data) --jobs $(or $(JOBS),2) $(if $(OUT),--out $(OUT))

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
