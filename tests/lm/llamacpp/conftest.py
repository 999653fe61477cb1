"""What the tests of the llama.cpp backend that need weights share."""

from pathlib import Path

import pytest

from erag.lm.llamacpp.backend import LlamaCpp
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.llamacpp.library import library_version
from erag.lm.weights import ModelStore, default_store


@pytest.fixture(scope="session")
def gguf() -> ModelStore:
    """The model store with the default language model; tests that need it skip where it or the library is absent."""
    if library_version() is None:
        pytest.skip("no llama.cpp: pip install 'erag[llamacpp]'")
    store = default_store()
    if store.state("smollm2-135m") == "missing":
        pytest.skip("no weights: erag models pull smollm2-135m")
    return store


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache folder of these tests alone."""
    return tmp_path_factory.mktemp("llamacpp-cache")


@pytest.fixture(scope="session")
def smol(gguf: ModelStore, cache: Path) -> LlamaCpp:
    """SmolLM2 as shipped, one thread."""
    return LlamaCpp(LlamaCppConfig(threads=1, weights="shipped", context=1024), gguf, cache=cache)
