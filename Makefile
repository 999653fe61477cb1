# Two commands: `make demo` and `make test`. Each sets up .venv first (about 3 minutes, once) and says what it does.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
MODELS := minilm-l6

CLIP_READY := .venv-clip/.ready

.PHONY: demo test check-all check-clip lint types layers unit models clean

demo: $(READY) models
	@echo "== demo: ingest, build and ask the sample campus (about 15 s); results in demo-out/"
	@$(BIN)/erag demo --out demo-out

test: $(READY) models lint types layers unit

# What CI runs, and what needs environments or data of its own (a fresh clone, the outside data beside the repository).
check-all: test check-clip
	@echo "== check-all: kill -9 at ten moments of ingest and build, compared with an uninterrupted run (about 3 minutes)"
	@$(BIN)/python scripts/kill_test.py

# open_clip needs torchvision, and torchvision another torch than .venv's: an environment of its own.
check-clip: $(CLIP_READY)
	@echo "== check-clip: the clip captioner on a tiny model (10 s)"
	@OMP_NUM_THREADS=1 .venv-clip/bin/python -m pytest -q tests/lm/test_clip.py

$(CLIP_READY): pyproject.toml constraints.txt constraints-clip.txt
	@echo "== set-up: open_clip with torchvision into .venv-clip (about 2 minutes, 5.7 GB)"
	@$(PYTHON) -m venv .venv-clip
	@.venv-clip/bin/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=24"
	@grep -v '^torch==' constraints.txt > .venv-clip/constraints.txt
	@.venv-clip/bin/python -m pip install --quiet --disable-pip-version-check --constraint .venv-clip/constraints.txt \
		--constraint constraints-clip.txt --editable ".[clip,dev]"
	@touch $(CLIP_READY)

$(READY): pyproject.toml constraints.txt
	@echo "== set-up: Python packages into .venv (about 3 minutes, 1.5 GB)"
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "erag needs Python 3.11 or newer: make PYTHON=python3.11")'
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=24"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[sentence,torchlm,eyes,ocr,train,dev]"
	@touch $(READY)

models: $(READY)
	@echo "== models: $(MODELS) (91 MB, once; its sha256 is checked)"
	@$(BIN)/erag models pull $(MODELS)

lint: $(READY)
	@echo "== lint: ruff (2 s)"
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(READY)
	@echo "== types: mypy (20 s)"
	@$(BIN)/mypy

layers: $(READY)
	@echo "== layers: import-linter (2 s)"
	@$(BIN)/lint-imports --no-logo

unit: $(READY)
	@echo "== tests: pytest on two processes (about 3 minutes)"
	@OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -q

clean:
	rm -rf .venv .venv-clip demo-out .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
