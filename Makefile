# SPDX-License-Identifier: MIT
# The verbs of the project. `make help` lists them.

PYTHON := .venv/bin/python
HOST := build/host
CHECKED := build/checked
THREADS := build/threads
SIDE_BY_SIDE := $(MAKE) --no-print-directory -j2 --output-sync=target

.PHONY: all help setup firmware host checked assets demo test unit stability benchmarks bench bench-smoke noise hil matrix daemon-test \
        daemon-test-addresses daemon-test-threads soak guest-test fuzz-smoke fuzz mutation lint lint-fast format flash install clean

all: firmware host ## build the firmware image and the host programs

help: ## list the verbs
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: ## install what is needed (apt, npm, pip); does nothing the second time
	@tools/setup/install.sh

firmware: setup ## build/firmware/BOARD/stage.elf and stage.uf2, of the default board in build/firmware, too
	@$(MAKE) --no-print-directory -C firmware BOARD=

host: setup ## build/host/bin/{stagectl,rf,stagesim,stagectl-ingest}
	@test -e $(HOST)/build.ninja || cmake -S . -B $(HOST) -G Ninja -DOLS_TESTS=OFF >/dev/null
	@ninja -C $(HOST) --quiet

checked: setup ## the unit and stability tests and what they test, with ASan and UBSan, in build/checked
	@test -e $(CHECKED)/build.ninja || cmake -S . -B $(CHECKED) -G Ninja -DOLS_SANITIZE=ON >/dev/null
	@ninja -C $(CHECKED) --quiet unit_tests stability_tests

assets: setup ## fetch the CC0 head and environment maps into .cache/assets
	@python3 tools/stagesim/assets/fetch.py

demo: all assets ## the whole system once, end to end; results in out/demo
	@$(PYTHON) tools/demo/demo.py --out out/demo

test: all checked assets lint-fast unit stability bench-smoke fuzz-smoke daemon-test hil matrix-pytest guest-test ## everything that needs no hardware
	@echo "make test: all passed"

unit: checked firmware ## unit tests: C++ with sanitizers, Python, JavaScript
	@ctest --test-dir $(CHECKED) --output-on-failure -j2 --no-tests=error
	@$(SIDE_BY_SIDE) unit-pytest oracle-pytest unit-npm

unit-npm:
	@cd tools/stagesim/board && npm test --silent

# Suites of single-threaded tests, two at a time.
%-pytest:
	@$(PYTHON) -m pytest -q tests/$*

stability: checked ## the hard cases: naive method, ours, derived bound (docs/stability.md)
	@$(PYTHON) tests/stability/table.py --check
	@$(PYTHON) -m pytest -q tests/stability

benchmarks: setup
	@test -e $(HOST)/build.ninja || cmake -S . -B $(HOST) -G Ninja -DOLS_TESTS=OFF >/dev/null
	@ninja -C $(HOST) --quiet benchmarks

bench: benchmarks assets ## what accuracy costs (SUBJECT=name for one subject): out/bench, docs/accuracy.md; renders moving scenes the first time
	@$(PYTHON) tests/bench/bench.py $(if $(SUBJECT),--subject $(SUBJECT))

bench-smoke: benchmarks ## every benchmark once at tiny sizes, and the tests of their page
	@$(PYTHON) -m pytest -q tests/bench

noise: all ## Wenger's SNR comparison on the virtual stage, and what designed bases gain: out/bench, docs/bases.md
	@$(PYTHON) tests/bench/snr.py --out out/bench --page docs/bases.md
	@$(PYTHON) tests/bench/basis_gain.py --out out/bench --plot docs/images/basis_gain.png --page docs/bases.md

daemon-test: all ## the daemon: its API, takes, failures in each state, on the virtual stage
	@$(PYTHON) -m pytest -q tests/daemon

daemon-test-addresses: all ## the same, the daemon with AddressSanitizer and UndefinedBehaviorSanitizer
	@test -e $(CHECKED)/build.ninja || cmake -S . -B $(CHECKED) -G Ninja -DOLS_SANITIZE=ON >/dev/null
	@ninja -C $(CHECKED) --quiet stagectl
	@SERVE=$(CHECKED)/bin/stagectl ASAN_OPTIONS=quarantine_size_mb=8:verify_asan_link_order=0 $(PYTHON) -m pytest -q tests/daemon

daemon-test-threads: all ## the same, the daemon with ThreadSanitizer
	@test -e $(THREADS)/build.ninja || cmake -S . -B $(THREADS) -G Ninja -DOLS_SANITIZE_THREADS=ON -DOLS_TESTS=OFF >/dev/null
	@ninja -C $(THREADS) --quiet stagectl
	@SERVE=$(THREADS)/bin/stagectl TSAN_OPTIONS=suppressions=tests/daemon/threads.supp $(PYTHON) -m pytest -q tests/daemon

soak: all ## an hour and more of takes with random faults by the daemon (TAKES=n, SEED=n)
	@SOAK_TAKES=$(or $(TAKES),2500) SOAK_SEED=$(or $(SEED),1) $(PYTHON) -m pytest -q tests/daemon/test_service.py -k random_faults

hil: all ## the numbered board tests and the capture tests, on the emulated board or a real one (BOARD=usb:SERIAL)
	@$(SIDE_BY_SIDE) hil-pytest capture-pytest

matrix: host ## every fault between trigger and frame, a thousand times on each camera link: docs/faults.md
	@$(PYTHON) tests/matrix/matrix.py --page docs/faults.md

guest-test: all ## stagectl on the real kernel's CAN, USB, V4L2 and GPIO, in a QEMU guest (the first time some 220 MB to download)
	@$(PYTHON) -m pytest -q tests/guest

fuzz-smoke: setup ## earlier findings and a fixed set of inputs through every fuzzer
	@tests/fuzz/run.sh smoke

fuzz: setup ## ten minutes of every fuzzer; SECONDS_EACH=n for another budget
	@tests/fuzz/run.sh $(or $(SECONDS_EACH),600)

mutation: setup ## changes sequence.c, frame.c and fault.c in one place at a time: do the unit tests notice? (half an hour)
	@python3 tests/mutation/mutate.py

lint: host ## formatting, licence tags, file lengths, include directions, clang-tidy
	@python3 tools/lint/lint.py --tidy

lint-fast: setup
	@python3 tools/lint/lint.py

format: setup ## clang-format in place
	@git ls-files '*.cpp' '*.hpp' '*.c' '*.h' | xargs clang-format -i

flash: all ## write the image to the board on USB (BOARD=pico or feather_can, the board's firmware)
	@$(HOST)/bin/stagectl flash build/firmware/$(or $(BOARD),pico)/stage.uf2

install: host ## install the programs (DESTDIR, PREFIX)
	@cmake --install $(HOST) --prefix $(or $(PREFIX),/usr/local)

clean: ## remove what was built (not the caches)
	rm -rf $(HOST) $(CHECKED) $(THREADS) build/firmware out
