# Everything here works on a fresh machine that has make and python3 (3.11 to 3.14, for which Ray is built).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What running needs, with it the tools of development, and the compiled simulator.
RUNS := $(VENV)/runs
INSTALLED := $(VENV)/installed
COMPILED := $(VENV)/compiled

.PHONY: demo docs proof test test-service test-pages test-programs test-shapes test-rest check check-wheel serve format lock install pin-image check-image clean

demo: $(COMPILED)  ## start the service, calibrate the example campaign, print what came out
	@$(BIN)/python -m examples.demo

proof: $(COMPILED)  ## play three stories on concealed data, each ending with a report; under 15 minutes
	@$(BIN)/python -m benchmarks.proof --json

docs: $(INSTALLED)  ## build the manual, with a search that needs no server: build/manual/index.html
	@$(BIN)/python -m docs.manual

serve: $(COMPILED)  ## start the service and stay
	@$(BIN)/wingfit serve

test: install  ## every check and every test, five at a time: programs, servers and browsers wait more than they compute
	@$(MAKE) --no-print-directory -k -j5 test-service test-shapes test-rest test-programs test-pages check

# The parts import the same files at the same time: on a fresh clone, each would compile all of them.
.PHONY: collect
collect: $(INSTALLED)
	@$(BIN)/python -m pytest --collect-only -q > $(VENV)/collected || { tail -n 50 $(VENV)/collected; exit 1; }
test-service test-pages test-programs test-shapes test-rest: | collect

# Shapes of arrays are checked at every call in the tests of these; elsewhere that would take a fifth of the time.
SHAPED := tests/records tests/inference tests/diagnosis
test-shapes:
	$(BIN)/python -m pytest $(SHAPED) $(WORK)
test-service test-pages test-programs test-rest: export UNCHECKED_SHAPES := 1

# Put beside others, so that all parts take about as long.
WORK := tests/benchmarks tests/workers
BESIDE := tests/service/jobs tests/service/pages tests/contract tests/export tests/planning
test-service:
	$(BIN)/python -m pytest tests/service $(BESIDE:%=--ignore %)

test-pages:
	$(BIN)/python -m pytest $(BESIDE)

# They start programs, and wait for them.
PROGRAMS := tests/docs
test-programs:
	$(BIN)/python -m pytest $(PROGRAMS)

test-rest:
	$(BIN)/python -m pytest --ignore tests/service $(BESIDE:%=--ignore %) $(PROGRAMS:%=--ignore %) $(SHAPED:%=--ignore %) $(WORK:%=--ignore %)

check: $(INSTALLED) check-image  ## every check, no test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(MAKE) --no-print-directory check-wheel

# What is installed is the package wingfit and nothing beside it; import-linter, which follows no links, reads it there.
WHEEL := build/wheel
check-wheel: $(INSTALLED)  ## build the wheel, and check its imports
	@rm -rf $(WHEEL) build/lib build/bdist.*
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir $(WHEEL) .
	@$(BIN)/python -m zipfile --extract $(WHEEL)/wingfit-*.whl $(WHEEL)/tree
	@test "$$(ls $(WHEEL)/tree | grep -v dist-info)" = wingfit || { echo "the wheel installs more than wingfit"; exit 1; }
	@ln -s ../../../benchmarks $(WHEEL)/tree/benchmarks
	cd $(WHEEL)/tree && $(CURDIR)/$(BIN)/lint-imports --config $(CURDIR)/pyproject.toml --no-cache

format: $(INSTALLED)  ## rewrite the code in the house format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

install: $(RUNS)  ## only install, with the tools of development; the simulator is compiled meanwhile
	@$(MAKE) --no-print-directory -j2 $(INSTALLED) $(COMPILED)

# Stamps are written last, so an installation that was interrupted is done again. The package itself needs no index: its
# build tool is in the lock file, which as a list of constraints also gives the versions of what running needs.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
$(RUNS): pyproject.toml requirements.lock | $(BIN)/python
	$(PIP) --constraint requirements.lock setuptools
	$(PIP) --constraint requirements.lock --no-build-isolation -e .
	@touch $@

$(COMPILED): $(RUNS)
	@echo "compiling the simulator once ..." && $(BIN)/python -m wingfit.sim.warm
	@touch $@

$(INSTALLED): $(RUNS)
	$(PIP) -r requirements.lock
	@touch $@

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' \
		|| { echo "wingfit needs Python 3.11 to 3.14; say which with: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { echo "this Python cannot make virtual environments; on Debian and Ubuntu: apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# Versions only: no hashes, because the same file serves mirrors and machines with wheels of their own.
lock: | $(BIN)/python  ## choose the newest versions that pyproject.toml admits, and write them down
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --extra dev --no-annotate \
		--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" \
		pyproject.toml --output-file requirements.lock

# The digest of the index, which names the image of every processor.
BASE_IMAGE := python:3.11-slim
pin-image:  ## build on the newest Python image: needs docker with buildx, and the network
	@digest=$$(docker buildx imagetools inspect $(BASE_IMAGE) --format '{{.Manifest.Digest}}') \
		&& echo "$$digest" | grep -Eqx 'sha256:[0-9a-f]{64}' \
		|| { echo "no digest of $(BASE_IMAGE) could be had; is docker buildx there, and the network?" >&2; exit 1; }; \
	sed -i "s|^ARG PYTHON_IMAGE=.*|ARG PYTHON_IMAGE=$(BASE_IMAGE)@$$digest|" Dockerfile && grep '^ARG PYTHON_IMAGE' Dockerfile

check-image:  ## fail unless the image is built on one that is named by digest
	@grep -Eqx 'ARG PYTHON_IMAGE=$(BASE_IMAGE)@sha256:[0-9a-f]{64}' Dockerfile \
		|| { echo "the Dockerfile does not name $(BASE_IMAGE) by digest; run: make pin-image" >&2; exit 1; }

clean:  ## remove what was installed and cached here, but no data
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
