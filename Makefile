# Two commands: `make demo` and `make test`. Each sets up .venv first (about 3 minutes, once) and says what it does.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
MODELS := minilm-l6 smollm2-135m efficientnet-lite0
LLAMACPP := .venv-llamacpp/bin

CLIP_READY := .venv-clip/.ready

.PHONY: demo test check-all check-llamacpp check-clip lint types layers unit models clean

demo: $(READY) models
	@echo "== demo: a rendered campus, seen by a robot: captions, map, forest, questions, a page (about 2 minutes); results in demo-out/"
	@$(BIN)/erag demo --out demo-out

test: $(READY) models lint types layers unit

# What CI runs, and what needs environments or data of its own (a fresh clone, the outside data beside the repository).
check-all: test check-llamacpp check-clip
	@echo "== check-all: kill -9 at ten moments of ingest and build, compared with an uninterrupted run (about 5 minutes)"
	@$(BIN)/python scripts/kill_test.py

# llama.cpp is compiled here: g++ and about 4 minutes more.
check-llamacpp: .venv-llamacpp/.ready models
	@echo "== check-llamacpp: the llama.cpp engine with SmolLM2, and that PyTorch agrees with it (about 2 minutes)"
	@OMP_NUM_THREADS=2 $(LLAMACPP)/python -m pytest -q tests/lm/llamacpp tests/lm/torchlm/test_torchlm_llamacpp.py tests/lm/test_signs.py tests/lm/test_vlm.py
	@$(LLAMACPP)/erag doctor
	@$(LLAMACPP)/erag bench --config configs/bench/throughput.yaml

.venv-llamacpp/.ready: pyproject.toml constraints.txt
	@echo "== set-up: an environment with llama.cpp in .venv-llamacpp (5 to 10 minutes, 1.6 GB)"
	@$(PYTHON) -m venv .venv-llamacpp
	@$(LLAMACPP)/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=24"
	@$(LLAMACPP)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[sentence,torchlm,llamacpp,eyes,ocr,dev]"
	@touch $@

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
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
		--editable ".[sentence,torchlm,eyes,sim,train,report,experiment,dev]"
	@touch $(READY)

models: $(READY)
	@echo "== models: $(MODELS) (210 MB, once; their sha256 is checked)"
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
	@echo "== tests: pytest on two processes (about 6 minutes)"
	@OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -q

clean:
	rm -rf .venv .venv-llamacpp .venv-clip demo-out .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
