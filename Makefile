# make demo   raw test files to report PDFs        make test        quick tests
# make lint   ruff and pyright                     make test-thorough, make test-slow   the longer ones
# make bench  every benchmark, for hours           make bench QUICK=1   a few cases of each, within half an hour
# make docs   the site of docs/: pages, reference from the code, examples run; reports/out/docs/site.html
# make paper  the source paper walked through: seven CPU minutes, within five minutes on two idle cores;
#             make paper FULL=1 with 4,000 scenes, up to two hours
# make dist   wheel and source archive in reports/out/dist, checked
.PHONY: demo test test-thorough test-slow lint bench docs paper dist clean install
.DELETE_ON_ERROR:

PYTHON ?= python3
BIN := .venv/bin
SCENES ?= 200
WORKERS ?= 2
QUICK ?=
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1

install: .venv/.installed

.venv/.installed: pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) is missing; install the system package python3"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "make: Python 3.11, 3.12 or 3.13 is needed; name one with make PYTHON=python3.11"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "make: Python cannot make environments; install the system package python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,dev,docs]'
	@touch $@

demo: install
	PATH="$(CURDIR)/$(BIN):$$PATH" bash examples/demo.sh reports/out $(SCENES) $(WORKERS)

# tests start Python anew in many workers and commands: modules compiled once are kept, whatever the environment says
test test-thorough test-slow: export PYTHONDONTWRITEBYTECODE :=

test: install
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal

test-thorough: install
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal -m "thorough and not slow"

test-slow: install
	$(BIN)/python -m pytest -q -m slow

lint: install
	$(BIN)/ruff check .
	$(BIN)/pyright --pythonpath $(BIN)/python

bench: install
	QUICK=$(QUICK) PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python benchmarks/whole.py

docs: install
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/sphinx-build -q -W --keep-going docs reports/out/docs

paper: install
	@mkdir -p reports/out
	$(BIN)/python -m reports paper --out reports/out/paper$(if $(FULL),_full --full) --workers $(WORKERS)

dist: install
	rm -rf reports/out/dist
	$(BIN)/python -m build --outdir reports/out/dist .
	$(BIN)/twine check --strict reports/out/dist/*

clean:
	rm -rf .venv reports/out
