# Shared Autonomy Lab. `make` prints what there is.
#
# Everything is installed into .venv here; nothing else on the machine is touched, except that `make test`
# installs a Chromium when there is none. pip and npm use whatever index they are configured with.

PORT   ?= 8000
DATA   ?= data
PYTHON ?=
VENV   := .venv
PY     := $(VENV)/bin/python
CHECK_JS := $(PY) -m tests.javascript.check
# One more process than cores: much of a test is waiting for a lab that starts, or for a tick.
CORES_AND_ONE := $$($(PY) -c 'import os; print(1 + os.cpu_count())')
ON_ALL_CORES := --numprocesses $(CORES_AND_ONE) --dist loadscope
# What is imported is compiled then; compiling all of it takes as long as installing it, and a hundred MB.
PIP    := $(PY) -m pip --disable-pip-version-check install --quiet --no-compile
# pybullet comes with 170 MB of other robots, examples and a renderer, none of which is opened here.
UNOPENED := $(addprefix $(VENV)/lib/python3.*/site-packages/,pybullet_data pybullet_envs pybullet_examples pybullet_robots eglRenderer.*)

SHELL := /bin/sh
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# Python keeps what it compiled, whatever the machine's environment says: the tests start hundreds of processes.
unexport PYTHONDONTWRITEBYTECODE

# A .venv whose interpreter went away is made anew, whatever its stamps say.
ifneq ($(shell $(PY) -c 'print("ok")' 2>/dev/null),ok)
$(VENV)/.installed: FORCE
$(VENV)/.installed-test: FORCE
endif

# Pythons that the lab runs on, the best first: 3.11 has pybullet's own wheels and MuJoCo's, 3.13 and 3.12 those of
# pybullet's fork and MuJoCo's, 3.10 pybullet's alone, 3.14 MuJoCo's alone.
PYTHONS := 3.11 3.13 3.12 3.10 3.14

# Prints the first interpreter that really runs (a version manager's shim may not), is one of these, and can make
# environments. PYTHON=... is held to the same.
WHAT_TO_INSTALL = install one (Debian 12, Ubuntu 22.04 and later: apt-get install python3 python3-venv; anywhere: uv \
python install 3.13) or name one: make $(MAKECMDGOALS) PYTHON=/path/to/python3.13
define FIND_PYTHON
usable() { "$$1" -c 'import ensurepip, sys, venv; sys.exit("%d.%d" % sys.version_info[:2] not in sys.argv[1:])' $$2 >/dev/null 2>&1; }; \
find_python() { \
  if [ -n "$(PYTHON)" ]; then \
    if usable "$(PYTHON)" "$(PYTHONS)"; then echo "$(PYTHON)"; return; fi; \
    echo "make: PYTHON=$(PYTHON) is no Python 3.10 to 3.14 with its venv module: $(WHAT_TO_INSTALL)" >&2; return 1; \
  fi; \
  for version in $(PYTHONS); do \
    dirs=$$(echo "$$PATH" | tr ':' ' '); \
    for dir in $$dirs "$$HOME"/.pyenv/versions/$$version*/bin "$$HOME"/.local/bin /usr/local/bin; do \
      for name in python$$version python3 python; do \
        if [ -x "$$dir/$$name" ] && usable "$$dir/$$name" $$version; then echo "$$dir/$$name"; return; fi; \
      done; \
    done; \
  done; \
  echo "make: no Python 3.10 to 3.14 with its venv module found: $(WHAT_TO_INSTALL)" >&2; \
  return 1; \
}
endef

.PHONY: help run test test-long test-fast check check-js bench faults soak fuzz docs wheel test-pythons clean FORCE

help: ## print this
	@echo "Shared Autonomy Lab"
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo "  (run takes PORT=$(PORT) and DATA=$(DATA); PYTHON=... chooses the interpreter .venv is made with)"

run: $(VENV)/.installed ## install what is missing and start the lab on loopback
	@exec $(VENV)/bin/salab serve --port "$(PORT)" --data "$(DATA)"

test: $(VENV)/.installed-test ## everything: linters, formatting, types, the tests (installs a Chromium if there is none)
	@echo "== a browser for the tests"
	@$(PY) -m tests.support.chromium
	@$(PY) -m tests.support.real_keys
	@$(PY) -m tests.support.postgres_server
	@echo "== ruff"
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@echo "== mypy"
	@$(PY) -m mypy
	@echo "== JavaScript"
	@$(CHECK_JS)
	@echo "== pytest: what needs no browser, on all cores"
	@$(PY) -m pytest $(ON_ALL_CORES) -m "not browser and not long"
	@echo "== pytest: what drives a browser, file by file"
	@$(PY) -m pytest --numprocesses $(CORES_AND_ONE) --dist loadfile --no-loadscope-reorder -m "browser and not long"

test-long: $(VENV)/.installed-test ## the other cases of those kinds that `make test` has examples of
	@$(PY) -m tests.support.chromium
	@$(PY) -m pytest $(ON_ALL_CORES) -m long

test-fast: $(VENV)/.installed-test ## the quick tests: no browser, no physics, no lab that runs, nothing slow
	@$(PY) -m pytest $(ON_ALL_CORES) -m quick

check: $(VENV)/.installed-test ## while working: ruff, formatting, mypy, check-js, test-fast
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@$(PY) -m mypy
	@$(CHECK_JS)
	@$(PY) -m pytest $(ON_ALL_CORES) -m quick

check-js: $(VENV)/.installed-test ## the pages' JavaScript: formatting, lint, types (needs Node.js)
	@$(CHECK_JS)

bench: $(VENV)/.installed-test ## measure decisions, ticks, live sessions, pictures, simulated studies and analysis
	@$(PY) -m tests.bench

faults: $(VENV)/.installed-test ## kill, starve, fill, lock, cut and flood labs; what people saw, for how long, what was kept
	@$(PY) -m tests.faults $(FAULTS)

soak: $(VENV)/.installed-test ## half an hour of eight participants with a fault every 20 s: memory flat, counts equal
	@$(PY) -m tests.soak $(SOAK)

fuzz: $(VENV)/.installed-test ## 100,000 inputs that nobody would send; SEED=7 repeats them, INPUTS=1000 are fewer
	@$(PY) -m tests.fuzz $(if $(SEED),--seed $(SEED)) $(if $(INPUTS),--inputs $(INPUTS))

docs: $(VENV)/.installed-test ## build the documentation into build/docs, from the code and without the internet
	@$(PY) -m sphinx -W --keep-going -n -q -b html docs build/docs
	@echo "open build/docs/index.html"

test-pythons: $(VENV)/.installed-test ## the fast part of the tests on every other Python there is; wheels of other systems
	@$(PY) -m tests.pythons

wheel: $(VENV)/.installed-test ## build the package into dist/: a wheel, and the sources
	@$(PY) -m hatchling build -d dist

clean: ## remove the environment and caches; never the data
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info tests/javascript/node_modules
	find app docs sim study tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.installed: pyproject.toml
	@$(FIND_PYTHON); \
	if ! $(PY) -c '' 2>/dev/null; then \
	  python=$$(find_python) || exit 1; \
	  echo "== making $(VENV) with $$python"; \
	  "$$python" -m venv --clear $(VENV) || exit 1; \
	fi
	@echo "== installing the lab (a minute the first time)"
	@$(PIP) --editable '.[bullet,analysis]'
	@rm -rf $(UNOPENED)
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	@echo "== installing what the tests and the documentation need"
	@$(PIP) --editable '.[bullet,analysis,postgres,meshes,test,docs]'
	@touch $@
