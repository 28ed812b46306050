# Two commands do everything on a machine with Python 3.11+ and make: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
MISSION ?= two-cups

.DEFAULT_GOAL := help

help: ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-14s %s\n", $$1, $$2}'

demo: $(VENV)/runtime ## two robots bring two cups, in physics, from a fresh machine
	$(BIN)/robotctl demo $(MISSION)

test: $(VENV)/development ## every test
	$(BIN)/python -m pytest

fuzz: $(VENV)/development ## 100,000 odd values on every key of real processes; all stay up and go on
	$(BIN)/python -m tests.fuzz.run

laws: $(VENV)/development ## the property tests with new examples, where `make test` has the same each time
	$(BIN)/python -m pytest tests/properties --hypothesis-profile=new

lint: $(VENV)/development ## style
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/development ## types
	$(BIN)/mypy

imports: $(VENV)/development ## which package may import which
	$(BIN)/lint-imports

check: lint types imports test ## everything that CI runs

bench: $(VENV)/development ## measure planner, running plan and start; prints tables
	for file in benchmarks/bench_*.py; do $(BIN)/python $$file || exit 1; done

bench-planning: $(VENV)/development ## the suite of household missions; writes docs/benchmarks/planning.md
	$(BIN)/python -m benchmarks.planning.run --out docs/benchmarks

bench-language: $(VENV)/development ## what is made of the suite of sentences; writes docs/benchmarks/language.md
	$(BIN)/python -m benchmarks.language.run

bench-allocation: $(VENV)/development ## allocators and schedulers; writes docs/benchmarks/allocation.md
	$(BIN)/python -m benchmarks.allocation.run --out docs/benchmarks

bench-scale: $(VENV)/development ## events, orders, starts, idle hours by size and past; writes docs/benchmarks/scale.md
	$(BIN)/python -m benchmarks.scale.run --out docs/benchmarks

bench-traffic: $(VENV)/development ## arrivals by number of robots; writes docs/benchmarks/traffic.md
	$(BIN)/python -m benchmarks.traffic.run --out docs/benchmarks

chaos: $(VENV)/development ## random faults in missions, judged from outside: FAULTS=300 MISSIONS=60 SEED=0 BACKEND=kinematic
	$(BIN)/python -m benchmarks.chaos.run --faults $(or $(FAULTS),300) --missions $(or $(MISSIONS),60) \
		--seed $(or $(SEED),0) --backend $(or $(BACKEND),kinematic)

docs: $(VENV)/development ## write the generated pages under docs/
	$(BIN)/python -m keyexpr_schema.document
	$(BIN)/python -m benchmarks.language.document
	$(BIN)/python -m benchmarks.figures.router_layouts

screenshots: $(VENV)/runtime ## run the demonstrations and make the pictures of the README from them
	for shot in two-cups:56 find-cup:60 apartment:128 warehouse:110; do \
		mission=$${shot%:*}; rm -rf runs/screenshots-$$mission; \
		how=; [ $$mission = warehouse ] && how="--backend kinematic --headless-speed 8"; \
		$(BIN)/robotctl demo $$mission $$how --out runs/screenshots-$$mission && \
		$(BIN)/python -m fleet.timeline.screenshot runs/screenshots-$$mission/recording.rrd \
			docs/screenshots/$$mission.png --at $${shot#*:} || exit 1; \
	done
	$(BIN)/python docs/screenshots/status.py docs/screenshots/status.svg

lock: $(VENV)/development ## renew the pinned versions of everything
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-header pyproject.toml build-requirements.in -o requirements.lock
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-header pyproject.toml build-requirements.in --group dev --group bench \
		-o requirements-dev.lock

clean: ## remove everything that is made
	rm -rf $(VENV) runs build .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info

# --- installation --------------------------------------------------------------------------------
$(VENV)/created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "$(PYTHON) is older than 3.11: name a newer one, as in make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/runtime: requirements.lock pyproject.toml setup.py | $(VENV)/created
	@echo "Installing into $(VENV) what requirements.lock names: once, and it takes a minute or some."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

$(VENV)/development: requirements-dev.lock pyproject.toml setup.py | $(VENV)/created
	@echo "Installing into $(VENV) what requirements-dev.lock names: once, and it takes a minute or some."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-dev.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@ $(VENV)/runtime

.PHONY: help demo test fuzz laws lint types imports check bench bench-planning bench-allocation bench-scale bench-traffic chaos docs screenshots lock clean
