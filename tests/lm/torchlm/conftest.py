"""Fixtures for the torchlm backend: a tiny model read and laid out once."""

from __future__ import annotations

from pathlib import Path

import pytest
from torchlm_worlds import LLAMA, QWEN, Tiny, tiny_store, weights, write_gguf

from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.torchlm.container import Container, open_container
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.shape import shape_of
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.torchlm.weights import dequantised
from erag.lm.weights import ModelStore


@pytest.fixture(scope="session")
def container(tmp_path_factory: pytest.TempPathFactory) -> Container:
    """A tiny Llama in a GGUF file."""
    return open_container(write_gguf(tmp_path_factory.mktemp("gguf") / "tiny.gguf", LLAMA, weights(LLAMA)))


@pytest.fixture(scope="session")
def vocabulary(container: Container) -> Vocabulary:
    return Vocabulary(container)


@pytest.fixture(scope="session")
def decoder(container: Container) -> Decoder:
    shape = shape_of(container)
    return Decoder(shape, dequantised(container, shape, "float32"), "plain")


@pytest.fixture(scope="session")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    """A model store with the tiny Llama."""
    return tiny_store(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder for dequantised weights."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="session")
def model(store: ModelStore, cache: Path) -> TorchLM:
    """The tiny Llama in float32."""
    return TorchLM(TorchLMConfig(model="tiny", dtype="float32"), store, cache=cache)


@pytest.fixture(params=[LLAMA, QWEN], ids=lambda tiny: tiny.arch)
def tiny(request: pytest.FixtureRequest) -> Tiny:
    return request.param
