"""The sentence embedder against the library it stands in for."""

import json

import numpy as np
import pytest

from erag.core.errors import ModelError
from erag.data.sample import sample_dir
from erag.lm.ledger import Ledger
from erag.lm.offline import go_offline
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.weights import ModelStore

pytestmark = pytest.mark.weights


@pytest.fixture(scope="module")
def texts() -> list[str]:
    lines = (sample_dir() / "observations.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line)["caption"] for line in lines] + ["bench", "word " * 400]


def test_vectors_equal_those_of_sentence_transformers(weights: ModelStore, texts: list[str]) -> None:
    go_offline()
    from sentence_transformers import SentenceTransformer

    library = SentenceTransformer(str(weights.path("minilm-l6")), device="cpu", local_files_only=True)
    expected = library.encode(texts, normalize_embeddings=True)
    ours = SentenceEmbedder(SentenceConfig(dtype="float32"), weights).embed(texts, "document")
    assert np.abs(ours - expected).max() < 1e-5


def test_bf16_stays_close_to_float32(weights: ModelStore, texts: list[str]) -> None:
    exact = SentenceEmbedder(SentenceConfig(dtype="float32"), weights).embed(texts, "document")
    fast = SentenceEmbedder(SentenceConfig(dtype="bfloat16"), weights).embed(texts, "document")
    assert (exact * fast).sum(axis=1).min() > 0.999


def test_other_architectures_go_through_the_library(
    weights: ModelStore, texts: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("erag.lm.sentence.is_plain_bert", lambda folder: False)
    through = SentenceEmbedder(SentenceConfig(dtype="float32"), weights).embed(texts[:8], "document")
    monkeypatch.undo()
    ours = SentenceEmbedder(SentenceConfig(dtype="float32"), weights).embed(texts[:8], "document")
    assert np.abs(ours - through).max() < 1e-5


def test_cut_texts_are_counted(weights: ModelStore, texts: list[str]) -> None:
    ledger = Ledger()
    SentenceEmbedder(SentenceConfig(), weights, ledger).embed(texts, "document")
    assert ledger.events["texts cut to the embedder's length"] == 1


def test_identity_ignores_precision_but_the_fingerprint_does_not(weights: ModelStore) -> None:
    one, two = (SentenceEmbedder(SentenceConfig(dtype=d), weights) for d in ("float32", "bfloat16"))
    assert one.identity("embed") == two.identity("embed")
    assert one.fingerprint("embed") != two.fingerprint("embed")


def test_missing_weights_name_the_command_that_gets_them(
    weights: ModelStore, tmp_path_factory: pytest.TempPathFactory
) -> None:
    empty = ModelStore(weights.manifests, tmp_path_factory.mktemp("files"))
    with pytest.raises(ModelError, match="erag models pull minilm-l6"):
        SentenceEmbedder(SentenceConfig(), empty).embed(["a"], "query")
