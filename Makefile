# Everything a developer types. Needs only Python 3.10 to 3.13 with pip, make and git; where ROS 2
# is sourced that one is used, elsewhere rclpy and its middleware come as wheels.

.DEFAULT_GOAL := help
.PHONY: help venv demo bench campaign detection-study fuzz soak test test-pins lint colcon clean

PYTHON ?= python3
PACKAGE := fault_tolerance

# The ROS wheels set this once they have prepared a process; another environment needs its own.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

ROS_SOURCED := $(if $(ROS_DISTRO),$(shell $(PYTHON) -c 'import rclpy' 2>/dev/null && echo yes))

ifeq ($(ROS_SOURCED),yes)
FORM := $(ROS_DISTRO)
EXTRAS := plot,record,test
VENV_FLAGS := --system-site-packages
BASE_PYTHON := $(PYTHON)
else
FORM := wheels
EXTRAS := ros,plot,record,test
VENV_FLAGS :=
# Another version may do where python3 is too old or too new; a PYTHON the user chose is kept.
SPARE_PYTHONS := $(if $(filter file,$(origin PYTHON)),python3.13 python3.12 python3.11 python3.10)
BASE_PYTHON := $(shell for python in $(PYTHON) $(SPARE_PYTHONS); do \
	"$$python" -c 'import sys; \
	assert (3, 10) <= sys.version_info[:2] <= (3, 13); \
	print(getattr(sys, "_base_executable", sys.executable))' 2>/dev/null && break; done)
endif

VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.installed-$(FORM)
PINS_VENV := .venv-pins
PINS_STAMP := $(PINS_VENV)/.installed

# Ubuntu 24.04's Python where the machine has it (a pyenv shim may be there and not run).
PINS_PYTHON = $(shell for python in python3.12 "$${PYENV_ROOT:-$$HOME/.pyenv}"/versions/3.12*/bin/python; do \
	"$$python" -c 'import sys; print(sys.executable)' 2>/dev/null && break; done)

# $(call new_venv,PYTHON,FLAGS,FOLDER): a fresh virtual environment with pip in it.
# Debian and Ubuntu leave ensurepip out of their python3 package: then pip installs pip.
define new_venv
	@rm -rf $(3)
	@"$(1)" -m venv $(2) $(3) >/dev/null 2>&1 || \
	{ rm -rf $(3) && "$(1)" -m venv --without-pip $(2) $(3) && \
	  "$(1)" -m pip --python $(3)/bin/python install -q pip; }
endef

help:  ## Show what can be made
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-15s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

venv: $(STAMP)  ## Prepare .venv, once (PYTHON=... chooses the interpreter)

$(STAMP): setup.py setup.cfg package.xml
	@test -n "$(BASE_PYTHON)" || { \
	  echo "make: Python 3.10 to 3.13 is needed; $(PYTHON) is not one (set PYTHON=...)" >&2; exit 1; }
	@echo "Preparing $(VENV) with $(BASE_PYTHON) ($(FORM)); this happens once"
	$(call new_venv,$(BASE_PYTHON),$(VENV_FLAGS),$(VENV))
	@$(RUN) -m pip install -q --disable-pip-version-check -e '.[$(EXTRAS)]'
	@touch $@

demo: venv  ## Run the demonstration (ENGINE=... and ARGS=... are passed on)
	@$(RUN) -m $(PACKAGE) demo $(if $(ENGINE),--engine $(ENGINE)) $(ARGS)

bench: $(VENV)/.peers  ## Measure speed, beside peers where they install (ARGS=--quick: a short run)
	$(RUN) -m benchmark $(ARGS)

# Where not all install, each is tried: what does not is left out of the comparison.
$(VENV)/.peers: $(STAMP)
	@$(RUN) -m pip install -q --disable-pip-version-check -e '.[bench]' 2>/dev/null || \
	for peer in mink mujoco pin pin-pink; do \
	  $(RUN) -m pip install -q --disable-pip-version-check "$$peer" 2>/dev/null || \
	  echo "make: $$peer does not install here: left out"; done
	@touch $@

campaign: venv  ## Try every single and double failure against the theory (ARGS=...)
	@$(RUN) -m $(PACKAGE) campaign $(ARGS)

detection-study: venv  ## False alarms in 1e8 healthy cycles, delays (ARGS='--cycles 1e7': a shorter one)
	@$(RUN) -m $(PACKAGE) detection-study $(ARGS)

fuzz: venv  ## Send the nodes nonsense (SECONDS=600, SEED=1, ARGS=...)
	FUZZ_SECONDS=$(or $(SECONDS),600) FUZZ_SEED=$(or $(SEED),1) \
	  $(RUN) -m pytest -o faulthandler_timeout=0 test/system/test_fuzz.py -s $(ARGS)

soak: venv  ## A failure and a clearing every second (SECONDS=1800, ARGS=...)
	SOAK_SECONDS=$(or $(SECONDS),1800) \
	  $(RUN) -m pytest -o faulthandler_timeout=0 test/system/test_soak.py -s $(ARGS)

test: venv  ## Run every test once, two processors' worth at a time
	@$(RUN) test/everything.py $(ARGS)

test-pins: $(PINS_STAMP)  ## Run every test with the versions of Ubuntu 24.04
	@$(PINS_VENV)/bin/python test/everything.py $(ARGS)

$(PINS_STAMP): setup.py setup.cfg package.xml .ci/ubuntu-24.04.txt
	@echo "Preparing $(PINS_VENV) with $(or $(PINS_PYTHON),$(BASE_PYTHON))"
	$(call new_venv,$(or $(PINS_PYTHON),$(BASE_PYTHON)),,$(PINS_VENV))
	@$(PINS_VENV)/bin/python -m pip install -q --disable-pip-version-check \
	  -c .ci/ubuntu-24.04.txt setuptools wheel
	@$(PINS_VENV)/bin/python -m pip install -q --disable-pip-version-check \
	  -c .ci/ubuntu-24.04.txt --no-build-isolation -e '.[ros,plot,record,test]'
	@touch $@

lint: $(VENV)/.linters  ## Check style (ruff) and types (mypy)
	$(RUN) -m ruff check .
	$(RUN) -m mypy

$(VENV)/.linters: $(STAMP)
	@$(RUN) -m pip install -q --disable-pip-version-check -e '.[dev]'
	@touch $@

colcon: venv  ## Build with colcon in a scratch folder and run what it installs
	$(RUN) -m pytest test/packaging/test_colcon.py $(ARGS)

clean:  ## Remove everything that can be made again
	rm -rf .venv .venv-pins build dist install log *.egg-info
	rm -rf demo_output campaign_output bench_output detection_output map_output route_output design_output
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
