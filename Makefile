# anglecam: `make demo` shows the whole way once, `make test` proves it. Both set themselves up.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run-ready
DEV := $(VENV)/.dev-ready
TEST_PACKAGES := libegl1 libgl1 libgl1-mesa-dri chromium
DEMO := build/demo

# uv installs in seconds what takes pip minutes; it compiles bytecode as pip does, without which every process starts two
# seconds later where Python may not write it. pip is the way out where only pip is configured to reach an index.
INSTALL = install() { \
	  $(BIN)/uv pip install -q --compile-bytecode --python $(BIN)/python "$$@" \
	    || { echo "setup: uv could not install; trying again with pip, which is slower" && \
	         $(BIN)/python -m pip install -q --disable-pip-version-check "$$@"; }; }; install --no-build-isolation
COMPILE = $(BIN)/uv pip compile -q --universal --generate-hashes --no-emit-index-url --python-version 3.11 \
	  --custom-compile-command "make lock"
# Installs the system packages of a list that Debian or Ubuntu lack, after naming them: $(call system,PACKAGES)
system = @missing=""; \
	if command -v dpkg-query >/dev/null; then \
	  for p in $(1); do dpkg-query -W -f '$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
	else \
	  echo "setup: not a Debian or Ubuntu machine; install the equivalents of these packages if they are missing: $(1)"; \
	fi; \
	if [ -n "$$missing" ]; then \
	  echo "setup: these system packages are missing and will be installed with apt-get:$$missing"; \
	  if [ "$$(id -u)" = 0 ]; then as=""; else as="sudo"; fi; \
	  $$as apt-get update -q && DEBIAN_FRONTEND=noninteractive $$as apt-get install -q -y --no-install-recommends $$missing; \
	fi

.DEFAULT_GOAL := help
.PHONY: help setup venv-module test-packages demo test sweep check docs lock clean

help: ## list what there is
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-8s %s\n", $$1, $$2}'

setup: venv-module $(RUN) ## .venv with the packages that anglecam needs to run, and its kernels compiled
	@$(BIN)/python -m anglecam.prepare anglecam synth
	@echo "setup: done; next: $(BIN)/anglecam doctor"

# Debian's python3 comes without the module that makes virtual environments.
VENV_MODULE := $(shell $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv)
venv-module:
	$(if $(VENV_MODULE),$(call system,$(VENV_MODULE)),@:)

# The tests also draw with OpenGL, off screen, by Mesa's EGL, and use the pages in Chromium.
test-packages:
	$(call system,$(TEST_PACKAGES))

$(RUN): pyproject.toml requirements/build.lock requirements/run.lock
	@echo "setup: making $(VENV) (1.0 GB) with the packages of requirements/run.lock"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements/build.lock
	@$(INSTALL) --require-hashes -r requirements/run.lock
	@$(INSTALL) --no-deps -e .
	@touch $@

$(DEV): $(RUN) requirements/dev.lock
	@echo "setup: adding the packages of requirements/dev.lock, which the tests need, to $(VENV)"
	@$(INSTALL) --require-hashes -r requirements/dev.lock
	@touch $@

demo: setup ## render a rig with a hidden effect, measure it, find the effect, write the report
	@rm -rf $(DEMO)
	$(BIN)/synth render configs/demo.yaml --out $(DEMO)/session --truth $(DEMO)/truth
	$(BIN)/anglecam close $(DEMO)/session --out $(DEMO)/result
	$(BIN)/synth score $(DEMO)/result --truth $(DEMO)/truth

# Many tests start processes; they start in three quarters of the time where bytecode of anglecam is kept.
test: venv-module test-packages $(DEV) ## everything that must pass
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest

sweep: venv-module test-packages $(DEV) ## the claims at their full size, which make test leaves out; the result goes to benchmarks
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m benchmarks.sweep

check: venv-module $(DEV) ## style, types, docstrings and the direction of imports, in seconds
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy && $(BIN)/lint-imports --no-logo

docs: venv-module test-packages $(DEV) ## the documentation site in build/site, its notebook executed; nothing is fetched
	$(BIN)/python docs/build_site.py

lock: setup ## pin the dependencies anew
	$(COMPILE) requirements/build.in -o requirements/build.lock
	$(COMPILE) pyproject.toml -o requirements/run.lock
	$(COMPILE) pyproject.toml --group dev --constraint requirements/run.lock -o requirements/dev.lock

clean: ## remove what was built
	rm -rf build $(VENV)
