# Two commands matter: `make demo` (see the robot drive) and `make test`. Both install what is missing.
.PHONY: help demo test test-all coverage lint format firmware chip protocol reference docs wheel wheel-aarch64 sdist bench bench-peers results soak mutation clean

# Where this is set, each of some thousand short processes of the tests would compile all modules again.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?=
HOURS ?= 2
SELECTED = not slow
VENV := .venv
# The versions of Python's packages: those of constraints.txt; `make CONSTRAINTS= ...` takes the newest.
CONSTRAINTS := constraints.txt
# Where the sources are public: the link at the top of the site. Empty in a clone of a folder.
REPOSITORY = $(if $(GITHUB_REPOSITORY),https://github.com/$(GITHUB_REPOSITORY),$(shell git config remote.origin.url | sed -n 's|\.git$$||; /^https:/p'))
# Where GitHub publishes the site: a link to it that is sent shows a picture.
PAGES := $(if $(GITHUB_REPOSITORY),https://$(subst /,.github.io/,$(GITHUB_REPOSITORY))/)
INSTALL = scripts/install-python $(BIN)/python $(CONSTRAINTS:%=--constraint %) --editable
BIN := $(VENV)/bin
PACKAGES := gcc-avr avr-libc binutils-avr libsimavr-dev g++ python3-venv
TEST_PACKAGES := clang-format clang clang-tidy llvm libclang-rt-dev simavr arduino-core-avr avrdude chromium-headless-shell python3-rosbag

help:
	@echo "make demo      install what is missing, build, and drive the two missions in simulation (results in out/)"
	@echo "make test      install what is missing, build, and run the tests"
	@echo "make test-all  the same with the slow tests, which repeat what others check"
	@echo "make lint      ruff, mypy --strict, house words, clang-format, clang-tidy on the firmware's core"
	@echo "make coverage  what the tests run: all lines and conditions of the firmware's core, 90 % of Python's lines"
	@echo "make firmware  build firmware/build/thumper.elf and .hex and those of the second board, print their size"
	@echo "make reference write the reference pages of commands, options and Python"
	@echo "make docs      build the documentation's site, with a robot on its front page, into site/; a dead link is an error"
	@echo "make wheel     build a wheel in dist/, install it into an empty environment and drive the demo from it"
	@echo "make wheel-aarch64  the same for 64-bit ARM; drives a simulated robot in qemu"
	@echo "make sdist     pack the sources into dist/"
	@echo "make bench     run every benchmark and write docs/results/benchmarks.md and its pages"
	@echo "make bench-peers  fetch and build navfn, ROS DWA, gmapping, LaMa, run them and ours in turn, print the ratios"
	@echo "make results   drive the sample campaigns again and write their reports into docs/results/"
	@echo "make soak      two simulated hours of goals and faults (half an hour); HOURS=8 for more, see docs/results/soak.md"
	@echo "make mutation  change the firmware, and what decides in the host, line by line; a test must notice (an hour)"

ifeq ($(MAKECMDGOALS)$(wildcard $(VENV)/.kernels),demo)
$(info the first time takes 2 to 4 minutes)
endif

demo: firmware chip $(VENV)/.kernels
	@$(BIN)/thumper demo

test: firmware chip $(VENV)/.dev $(VENV)/.kernels
	@$(BIN)/python -m pytest -n auto --dist worksteal -m "$(SELECTED)" --ignore tests/firmware/second_simulator

test-all: SELECTED =
test-all: test

# Numba's kernels run as machine code, where nothing is counted: they are left out of Python's figure.
coverage: firmware chip $(VENV)/.dev
	@$(BIN)/python -m tests.firmware.coverage
	@rm -f out/coverage*
	@$(BIN)/python -m coverage run -m pytest -n auto
	@$(BIN)/python -m coverage combine -q
	@$(BIN)/python -m coverage report

lint: $(VENV)/.dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/meta/test_language.py
	clang-format --dry-run --Werror $$(git ls-files '*.cpp' '*.hpp' '*.c' '*.h')
	clang-tidy --quiet --config-file=firmware/.clang-tidy tests/firmware/native/core_api.cpp -- \
	  -std=c++14 -Ifirmware -Itests/firmware -Itests/firmware/native
	for target in "thumbv6m-none-eabi -mcpu=cortex-m0plus" "riscv32-none-elf -march=rv32imc"; do \
	  clang++ --target=$$target -std=c++14 -ffreestanding -Os -Wall -Wextra -Werror -Ifirmware -c -o /dev/null \
	    tests/firmware/native/other_chips.cpp || exit 1; done

format: $(VENV)/.dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format
	clang-format -i $$(git ls-files '*.cpp' '*.hpp' '*.c' '*.h')

firmware: $(VENV)/.packages
	@$(MAKE) --no-print-directory -s -C firmware
	@$(MAKE) --no-print-directory -s -C firmware BOARD=nano

chip: $(VENV)/.run $(VENV)/.packages
	@$(MAKE) --no-print-directory -s -C hil/thumper_hil/chip/native

protocol: $(VENV)/.run
	$(BIN)/python firmware/protocol/generate.py

reference: $(VENV)/.dev
	$(BIN)/python scripts/generate_reference.py
	$(BIN)/python scripts/python_reference.py
	$(BIN)/python scripts/draw_architecture.py
	$(BIN)/python scripts/draw_badges.py

docs: firmware $(VENV)/.dev
	@sed '$(if $(REPOSITORY),s|^site_name|repo_url = "$(REPOSITORY)"\n&|);$(if $(PAGES),s|^site_description|site_url = "$(PAGES)"\n&|)' zensical.toml > .site.toml
	@$(BIN)/zensical build --clean --strict --config-file .site.toml
	@$(BIN)/python scripts/finish_pages.py site $(REPOSITORY)
	@$(BIN)/python scripts/search_weights.py site
	@scripts/build-browser site $(BIN)/python
	@echo 'The site is in site/: open site/index.html'

wheel: firmware $(VENV)/.release
	@rm -f dist/*_$$(uname -m).whl
	@scripts/build-wheel
	@scripts/check-wheel dist/*_$$(uname -m).whl

wheel-aarch64: firmware $(VENV)/.release
	@rm -f dist/*_aarch64.whl
	@scripts/build-wheel aarch64
	@scripts/check-aarch64 dist/*_aarch64.whl

sdist: $(VENV)/.release
	@rm -f dist/*.tar.gz
	@$(BIN)/python -m build --sdist --outdir dist . >/dev/null
	@$(BIN)/python -m twine check --strict dist/*.tar.gz

bench: firmware chip $(VENV)/.dev
	@$(BIN)/python benchmarks/table.py

bench-peers: $(VENV)/.dev
	@$(BIN)/python -m benchmarks.peers.planners
	@$(BIN)/python -m benchmarks.peers.controllers
	@$(BIN)/python -m benchmarks.peers.mappers

results: firmware chip $(VENV)/.dev
	@scripts/make-results

soak: firmware chip $(VENV)/.run
	@$(BIN)/python -m thumper_hil.bench.soak --hours $(HOURS)

mutation: firmware chip $(VENV)/.dev
	@$(BIN)/python -m tests.firmware.mutation.run core
	@$(BIN)/python -m tests.firmware.mutation.run board
	@$(BIN)/python -m tests.host.mutation.run

clean:
	rm -rf firmware/build hil/thumper_hil/chip/native/build host/thumper/kernels hil/thumper_hil/kernels tuning/thumper_tuning/kernels out site
	rm -f $(VENV)/.kernels

# Stamps: set-up is repeated only when what it depends on has changed.
$(VENV)/.packages: scripts/install-packages Makefile
	@scripts/install-packages $(PACKAGES)
	@mkdir -p $(VENV) && touch $@

# A stamp and not $(BIN)/python: an environment that was half made is made again.
$(VENV)/.made: | $(VENV)/.packages
	@PYTHON="$(PYTHON)" scripts/find-python >/dev/null
	@echo "creating the Python environment $(VENV)"
	@rm -rf $(BIN) $(VENV)/lib
	@python=$$(PYTHON="$(PYTHON)" scripts/find-python); "$$python" -m venv $(VENV) || { \
	  echo "thumper: $$python cannot make a virtual environment; install its venv package (python3.X-venv)" >&2; exit 1; }
	@touch $@

$(VENV)/.run: pyproject.toml $(CONSTRAINTS) | $(VENV)/.made
	@echo "installing Python packages into $(VENV)"
	@$(BIN)/python -m pip uninstall -qqy thumper  # the package's earlier name: its commands would appear twice
	@$(INSTALL) '.[ui]'
	@touch $@

# What has not changed is not compiled again.
$(VENV)/.kernels: $(shell find host/thumper hil/thumper_hil tuning/thumper_tuning scripts/ship_kernels.py -name '*.py') | $(VENV)/.run firmware chip
	@echo "loading the compiler"
	@THUMPER_SHIP_KERNELS=1 $(BIN)/python scripts/ship_kernels.py
	@touch $@

$(VENV)/.dev: pyproject.toml $(CONSTRAINTS) Makefile | $(VENV)/.made
	@scripts/install-packages $(TEST_PACKAGES)
	@echo "installing Python packages for the tests into $(VENV)"
	@$(BIN)/python -m pip uninstall -qqy thumper  # the package's earlier name: its commands would appear twice
	@$(INSTALL) '.[dev]'
	@touch $(VENV)/.run $@

$(VENV)/.release: pyproject.toml $(CONSTRAINTS) Makefile | $(VENV)/.made
	@$(INSTALL) '.[release]'
	@touch $@
