"""Fixtures for all tests."""

from pathlib import Path

import pytest
from hypothesis import settings

from erag.lm.weights import ModelStore, default_store

# Property tests: no deadline, since a busy machine is no defect, and the same examples in every run.
settings.register_profile("erag", deadline=None, derandomize=True)
settings.load_profile("erag")

SHARED = Path(__file__).resolve().parents[2] / "shared"
FAKE = "backend: {models: {fake: {kind: fake, call_size: 24}}, roles: {embed: fake}}\n"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of outside data beside the repository; tests that need it skip where it is absent."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"no outside data beside the repository ({SHARED.name}/data)")
    return SHARED


@pytest.fixture(scope="session")
def weights() -> ModelStore:
    """The model store with the default embedder; tests that need it skip where it was not pulled."""
    store = default_store()
    if store.state("minilm-l6") == "missing":
        pytest.skip("no weights: erag models pull minilm-l6")
    return store


@pytest.fixture(scope="session")
def smollm2() -> ModelStore:
    """The model store with the default language model; tests that need it skip where it was not pulled."""
    store = default_store()
    if store.state("smollm2-135m") == "missing":
        pytest.skip("no weights: erag models pull smollm2-135m")
    return store


@pytest.fixture(scope="session")
def fake_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration whose embedder needs no weights."""
    path = tmp_path_factory.mktemp("config") / "fake.yaml"
    path.write_text(FAKE)
    return path


@pytest.fixture(scope="session")
def campus(tmp_path_factory: pytest.TempPathFactory, fake_config: Path) -> Path:
    """The sample, built without weights. Read only."""
    from erag.data.sample import sample_dir
    from erag.pipeline.session import open_memory

    memory = open_memory(tmp_path_factory.mktemp("campus") / "campus.erag", config=fake_config)
    memory.ingest(sample_dir())
    memory.build()
    return memory.path
