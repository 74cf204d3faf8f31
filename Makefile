# make run          the paper's experiment on four processes, with its table and figures
# make check        lint, strict types and the fast tests, in under a minute: for every save
# make test         lint, strict types and every test, real processes included
# make bench        speed and memory beside other systems, in turn; BENCH="--quick" for a first look
# make compiled     the control loop in C: the twin runs twice as fast (needs a C compiler)
# make interpreted  without it again
# make docs         rewrite what documents say of the code: tables of keys, commands, exit codes
# make lock         renew the locked versions (needs uv)

PYTHON ?= python3
BIN := .venv/bin

.PHONY: run check test bench docs lint lock clean compiled interpreted

run: .venv/run
	$(BIN)/decmesh paper

check: lint
	$(BIN)/pytest -n 2 -m "not sampling and not processes and not slow"

test: lint
	$(BIN)/pytest -n 2

lint: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

compiled: .venv/dev interpreted
	$(BIN)/python -m deploy.compiling

interpreted:
	find protocol module_agent plant_server -name '*.so' -delete

bench: .venv/bench
	$(BIN)/python -m tests.bench $(BENCH)

docs: .venv/run
	$(BIN)/python -m deploy.generated --write

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/run: .venv/bin/python requirements.lock pyproject.toml
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

.venv/dev: .venv/run requirements-dev.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements-dev.lock
	touch $@

# What the bench compares with; what cannot be installed here is left out, and the bench says so.
.venv/bench: .venv/dev requirements-bench.lock
	-$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements-bench.lock
	touch $@

LOCK := uv pip compile pyproject.toml --universal --generate-hashes --no-emit-index-url --no-header --quiet --upgrade
lock:
	$(LOCK) --extra build --output-file requirements.lock
	$(LOCK) --extra dev --output-file requirements-dev.lock
	$(LOCK) --extra bench --constraint requirements-dev.lock --output-file requirements-bench.lock

clean:
	rm -rf .venv build *.egg-info runs
