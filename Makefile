# anglecam: `make demo` shows the whole way once, `make test` proves it. Both set themselves up.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.ready
LIBRARIES := libegl1 libgl1 libgl1-mesa-dri
DEMO := build/demo
SMALL := tests/blind/0029/spec.yaml

.DEFAULT_GOAL := help
.PHONY: help setup system demo test check lock clean

help: ## list what there is
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-8s %s\n", $$1, $$2}'

setup: system $(STAMP) ## system libraries, .venv and the locked packages

# Off-screen rendering needs Mesa's EGL; Debian's python3 comes without ensurepip. Names are said before rights are asked for.
system:
	@missing=""; \
	if command -v dpkg-query >/dev/null; then \
	  for p in $(LIBRARIES); do dpkg-query -W -f '$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
	  $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || missing="$$missing python3-venv"; \
	else \
	  echo "setup: not a Debian or Ubuntu machine; make sure Mesa's libEGL and libGL and Python's venv are installed"; \
	fi; \
	if [ -n "$$missing" ]; then \
	  echo "setup: these system packages are missing and will be installed with apt-get:$$missing"; \
	  if [ "$$(id -u)" = 0 ]; then as=""; else as="sudo"; fi; \
	  $$as apt-get update -q && DEBIAN_FRONTEND=noninteractive $$as apt-get install -q -y --no-install-recommends $$missing; \
	fi

$(STAMP): pyproject.toml requirements/build.lock requirements/anglecam.lock
	@echo "setup: making $(VENV) (1.1 GB) with the packages of requirements/anglecam.lock; this takes a minute or two"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements/build.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes --no-build-isolation -r requirements/anglecam.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@echo "setup: compiling the numerical kernels, once, on a small session; this takes another minute"
	@first=$$(mktemp -d); trap 'rm -rf '$$first EXIT; \
	{ $(BIN)/synth render $(SMALL) --out $$first/session --truth $$first/truth && \
	  $(BIN)/anglecam close $$first/session --out $$first/result; } > $$first/log 2>&1 || { cat $$first/log; exit 1; }
	@touch $@

demo: setup ## render a rig with a hidden effect, measure it, find the effect, write the report
	@rm -rf $(DEMO)
	$(BIN)/synth render configs/demo.yaml --out $(DEMO)/session --truth $(DEMO)/truth
	$(BIN)/anglecam close $(DEMO)/session --out $(DEMO)/result
	$(BIN)/synth score $(DEMO)/result --truth $(DEMO)/truth

test: setup ## everything that must pass
	$(BIN)/python -m pytest

check: setup ## style, types and docstrings, in seconds
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

lock: ## pin the dependencies anew (needs uv)
	uv pip compile -q --universal --generate-hashes --no-emit-index-url --python-version 3.11 \
	  --custom-compile-command "make lock" requirements/build.in -o requirements/build.lock
	uv pip compile -q --universal --generate-hashes --no-emit-index-url --python-version 3.11 \
	  --custom-compile-command "make lock" pyproject.toml --group dev -o requirements/anglecam.lock

clean: ## remove what was built
	rm -rf build $(VENV)
