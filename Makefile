# make demo: set up and run the main job.  make test: set up and run what CI runs.  make help: the rest.
PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help demo test test-full lint docs notebooks figures samples clean

help:
	@echo "make demo       set up .venv and clean the sample apartment; says where the figure is"
	@echo "make test       set up .venv and run everything CI runs"
	@echo "make test-full  the same, with the large campaigns whole"
	@echo "make docs       build the documentation in docs/_build/html"
	@echo "make notebooks  write notebooks/*.ipynb from their text sources again"
	@echo "make figures    draw the pictures of README and docs again"
	@echo "make samples    write the sample models again"

.venv/made: pyproject.toml
	@$(PYTHON) -c "import sys; sys.exit(None if sys.version_info >= (3, 11) else 'bimnav needs Python 3.11 or newer: make PYTHON=python3.12 ...')"
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	@$(BIN)/python -m pip install --quiet --editable .
	@touch $@

.venv/made-dev: .venv/made
	@$(BIN)/python -m pip install --quiet --group dev
	@touch $@

demo: .venv/made
	$(BIN)/bimnav run data/ifc/apartment.ifc --task cleaning --cell 0.5ft --out out
	@echo "the figure is out/plan.png, the replay page out/replay.html"

lint: .venv/made-dev
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

docs: .venv/made-dev
	$(BIN)/sphinx-build --fail-on-warning --keep-going -q -b html docs docs/_build/html

test: lint docs
	$(BIN)/pytest -n 2

test-full: lint docs
	$(BIN)/pytest -n 2 --full

notebooks: .venv/made-dev
	$(BIN)/python notebooks/pair.py

figures: .venv/made
	$(BIN)/python docs/make_figures.py

samples: .venv/made
	$(BIN)/python data/ifc/make_samples.py
	$(BIN)/python data/ifc/make_office.py

clean:
	rm -rf .venv out dist docs/_build .mypy_cache .ruff_cache .pytest_cache .hypothesis
