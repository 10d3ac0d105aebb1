# What a person types. Everything happens in .venv; nothing else on the machine is touched.
PYTHON ?= python3
BASE_PYTHON ?= $(BASE)/.venv/bin/python
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: run test test-slow dist docs lint format bench bench-jobs numbers numbers-slow clean

run: $(VENV)/installed  ## install, generate a world, learn a route, walk it, and print how to watch it
	$(BIN)/tussock world --preset tussock-field --seed 7 --out world.glb --picture world.png
	$(BIN)/tussock run --world world.glb --seed 7 --offset-m 0.1 --out run --overwrite
	@echo
	@echo "The agent's walk is in the folder run: look at run/overview.png, or watch it with"
	@echo "    $(BIN)/tussock play run          (a window)"
	@echo "    $(BIN)/tussock play run --web    (a browser, where there is no display)"

# The tests start many processes: modules are compiled once, not by each of them, wherever that is switched off.
test test-slow: export PYTHONDONTWRITEBYTECODE =

test: $(VENV)/developer  ## the quick tests, on all cores
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder

test-slow: $(VENV)/developer  ## the tests that take long: killed processes, full disks, whole studies, browsers
	$(BIN)/pytest -n auto -m slow

dist: $(VENV)/developer  ## a source archive and, made of it, a wheel, into dist/
	$(BIN)/python -m build --no-isolation --outdir dist

docs: $(VENV)/developer  ## the documentation site, into docs/_build; needs no network; a broken link or page fails
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet -b html docs docs/_build
	@echo "The documentation is in docs/_build/index.html"

lint: $(VENV)/developer  ## style, types, and which room may know which
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

format: $(VENV)/developer
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/developer  ## the benchmarks, into docs/performance.md; run it while nothing else runs
	for part in views matching walks worlds; do \
		$(BIN)/pytest benchmarks/bench_$$part.py --benchmark-quiet --benchmark-json=$(VENV)/bench_$$part.json || exit; done
	$(BIN)/python benchmarks/report.py $(foreach part,views matching walks worlds,$(VENV)/bench_$(part).json)

bench-jobs: $(VENV)/developer  ## whole jobs, next to those of another checkout: BASE=CHECKOUT BASE_PYTHON=its/python OPTIONS="--only run,sweep"
	$(BIN)/python benchmarks/jobs.py $(if $(BASE),--base $(BASE) --python $(BASE_PYTHON)) --results $(VENV)/jobs.json --docs $(OPTIONS)

numbers: $(VENV)/developer  ## the numbers that README and docs print, measured again and written into the pages: the quick ones
	$(BIN)/python docs/numbers/make.py

numbers-slow: $(VENV)/developer  ## the others; they take over an hour
	$(BIN)/python docs/numbers/make.py --slow

$(VENV)/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) -e .
	touch $@

$(VENV)/developer: $(VENV)/installed
	$(PIP) -e '.[dev]'
	mkdir -p $(VENV)/clone && ln -sfn ../.. $(VENV)/clone/tussock  # where pyright finds the package
	touch $@

clean:
	rm -rf $(VENV) run world.glb world.png dist docs/_build docs/jupyter_execute docs/recipes
