# make demo | test | lint | bench : each builds .venv first and never touches the system Python (PEP 668)
PYTHON ?= $(firstword $(foreach p,python3.11 python3.12 python3.13 python3,$(shell $(p) -c 'import ensurepip' 2>/dev/null && echo $(p))))
BIN    := .venv/bin
PIP    := $(BIN)/python -m pip install -q -c constraints.txt
PKGS   := envs terrain surrogate controllers native cli
CSRC   := native/CMakeLists.txt $(wildcard native/src/*.c native/src/*.h native/include/grouser/*.h)

.PHONY: demo test slow sanitize lint bench validate tick-study clean help
help:
	@echo 'make demo   dataset, training and the closed loop on four backends, into build/demo/'
	@echo 'make test   the test suite'
	@echo 'make slow   the studies that take minutes'
	@echo 'make sanitize  the tests of the C core under AddressSanitizer and UBSan'
	@echo 'make lint   ruff, mypy, import directions'
	@echo 'make validate  every check and study of the physics, into docs/validation/'
	@echo 'make bench  kernels, libraries, physics and environments timed, about 4 minutes, into build/bench/'
	@echo 'make tick-study  order, error, chatter and stability of the tick, about 5 minutes, into build/tick/'
demo: .venv/.native
	$(BIN)/grouser demo --output build/demo
test: .venv/.native
	$(BIN)/python -P -m pytest -q -n 2
slow: .venv/.native
	$(BIN)/python -P -m pytest -q -m slow
# Without site, so that the editable install does not stand before the sanitized one.
sanitize: .venv/.native
	rm -rf build/sanitize && CFLAGS='-fsanitize=address,undefined -fno-sanitize-recover=undefined -g' \
	  $(BIN)/python -m pip install -q --no-deps --no-build-isolation --target build/sanitize -C install.strip=false -C cmake.build-type=Debug .
	LD_PRELOAD=$$($(CC) -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0 \
	  PYTHONPATH=build/sanitize:$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') \
	  $(BIN)/python -S -P -m pytest -q -p no:cacheprovider tests/native tests/envs/test_fleet.py
lint: .venv/.native
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy && $(BIN)/mypy tests examples benchmarks && \
	  PYTHONSAFEPATH=1 $(BIN)/lint-imports
validate: .venv/.native
	$(BIN)/grouser validate --output docs/validation
bench: .venv/.bench
	$(BIN)/grouser bench --output build/bench
tick-study: .venv/.native
	$(BIN)/python -P benchmarks/tick_study.py --output build/tick

.venv/.deps: pyproject.toml constraints.txt
	$(if $(PYTHON),,$(error need Python >= 3.11 with venv: apt-get install python3-venv))
	test -x $(BIN)/pip || $(PYTHON) -m venv .venv
	$(PIP) 'pip>=25.1'
	$(PIP) $(TORCH_ARGS) torch
	$(PIP) --group dev
	touch $@
.venv/.native: .venv/.deps $(CSRC)
	$(PIP) --no-build-isolation -e '.[all]'
	mkdir -p build/typing/grouser && cd build/typing/grouser && ln -sfn $(PKGS:%=../../../%) . && \
	  echo '__version__: str' > __init__.pyi && touch py.typed
	touch $@
.venv/.bench: .venv/.native
	$(PIP) onnx onnxruntime
	touch $@
clean:
	rm -rf .venv build dist
