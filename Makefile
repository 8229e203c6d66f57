# `make run` and `make test` are all a newcomer needs; both set up what they use, from the lock files.
SHELL := /bin/bash
# Tests start processes by the dozen; without it each would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE
PYTHON ?= python3
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
HOST ?= 127.0.0.1
PORT ?= 8000
RECORDING ?=
MINUTES ?=
SEED ?=
bin := .venv/bin

.PHONY: run test test-all coverage mutants fuzz soak lint bench page-speed demo guide docs screenshots lock clean

run: .venv/.run
	$(bin)/lidarcore serve --host $(HOST) --http-port $(PORT) $(if $(RECORDING),"$(RECORDING)")

test: .venv/.dev lint
	@$(browser)
	@$(precompile)
	$(parallel) -m "not long"

# Also the tests marked `long`, each of which takes more than a few seconds; three times as long in all.
test-all: .venv/.dev lint
	@$(browser)
	@$(precompile)
	$(parallel)

# Of what `make test` runs, but for the browser. Coverage does not see compiled kernels: tests that are quick without
# the compiler run them once more as plain Python. Counting slows code and loses what a killed process counted: a few
# tests of speed and of signals fail for it, which ends nothing.
coverage: .venv/.dev
	@$(precompile)
	-$(parallel) -m "not long" --ignore tests/browser --cov --cov-report=
	NUMBA_DISABLE_JIT=1 $(parallel) -m "not long" --cov --cov-append --cov-report=term:skip-covered $(interpreted)

interpreted := $(addprefix tests/,geometry laws/test_published_formulas.py core/test_ends.py \
	core/test_ring.py::test_the_noise_seen_does_not_depend_on_the_start_of_the_ring \
	core/test_accounts.py::test_two_beams_make_a_segment_if_asked_for \
	core/test_simulation.py::test_rays_meet_the_nearest_wall evaluation/test_cramer_rao.py \
	localization/test_filter_kernels.py localization/test_models.py mapping/test_grid.py mapping/test_pose_graph.py \
	mapping/test_registration.py rplidar/test_protocol_formats.py rplidar/test_protocol_spacing.py)

# Whether the tests notice the seeded faults; in about half an hour.
mutants: .venv/.dev
	$(bin)/python tests/mutants/run.py

# Broken files, bytes of a sensor, messages and requests, in five minutes unless told otherwise (MINUTES, SEED).
fuzz: .venv/.dev
	$(bin)/python tests/fuzz/run.py $(MINUTES:%=--minutes %) $(SEED:%=--seed %)

# Whether a server that runs for an hour (MINUTES) stays as it was after five minutes.
soak: .venv/.dev
	$(bin)/python tests/soak/run.py $(MINUTES:%=--minutes %) $(SEED:%=--seed %)

parallel := $(bin)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder --max-worker-restart=0 --durations=15
# Otherwise every process of the tests would compile the same kernels.
precompile := $(bin)/python -m lidarcore.mapping.precompile
browser := command -v chromium-headless-shell >/dev/null || { $(SUDO) apt-get update && $(SUDO) apt-get install -y --no-install-recommends chromium-headless-shell fonts-dejavu-core; }

lint: .venv/.dev
	$(bin)/ruff check .
	$(bin)/ruff format --check .
	$(bin)/mypy

bench: .venv/.run
	$(bin)/lidarcore bench

# How fast the page is, in two Chromiums; in three minutes.
page-speed: .venv/.dev
	@$(browser)
	$(bin)/python docs/page_speed.py

# The page that explains the ellipses, measured and drawn anew; in a minute or two.
guide: .venv/.run
	$(bin)/python -m docs.guide static/guide.html

# The documentation, into docs/_build/html; the server shows it at /documentation/.
docs: .venv/.dev
	$(bin)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet --fresh-env --doctree-dir docs/_build/doctrees docs docs/_build/html
	@echo "Built: docs/_build/html/index.html"

# The pictures in the documentation, taken anew of an emulated sensor; in a minute or two.
screenshots: .venv/.dev
	@$(browser)
	$(bin)/python docs/screenshots.py docs/images

# What the wheel ships as a demo: an emulated sensor that moves, recorded as a real one would be.
demo: .venv/.run
	rm -f app/demo/emulated-s1.mcap && link=$$(mktemp -u) && (sleep 60 | $(bin)/lidarcore emulate --moving --seed 7 --link $$link & sleep 3; \
	$(bin)/lidarcore record app/demo/emulated-s1.mcap --port $$link --duration 12)

# Debian keeps venv in a package of its own.
.venv/bin/python:
	$(PYTHON) -m venv .venv || { $(SUDO) apt-get update && $(SUDO) apt-get install -y python3-venv && $(PYTHON) -m venv --clear .venv; }

# The lock files name everything. Asked for dependencies, pip would take the newest release of what a package wants with
# an extra (`coverage[toml]`), and refuse it as not locked: installing would fail from the day of that release on.
install := $(bin)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes

.venv/.run: requirements.lock pyproject.toml | .venv/bin/python
	$(install) -r requirements.lock
	@# setuptools warns of folders named like ours; they are ours
	PYTHONWARNINGS=ignore $(bin)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

.venv/.dev: requirements-dev.lock .venv/.run
	$(install) -r requirements-dev.lock
	@touch $@

# After a change of the dependencies in pyproject.toml; needs uv.
compile := uv pip compile --quiet --universal --generate-hashes --no-header --no-emit-index-url --no-annotate pyproject.toml
lock:
	$(compile) --group build -o requirements.lock
	$(compile) --group build --group dev --group docs -c requirements.lock -o requirements-dev.lock

clean:
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist docs/_build
