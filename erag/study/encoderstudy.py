"""A sentence encoder in other precisions: what its vectors and its hits lose, and how fast it is.

This module imports torch; it is itself imported only where the study runs.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

import torch

from erag.core.errors import ModelError
from erag.core.progress import Progress, quiet
from erag.lm.bert import BertEncoder, is_plain_bert
from erag.lm.int8 import Int8Encoder
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.sentence import Precision, SentenceConfig, SentenceEmbedder
from erag.lm.weights import ModelStore
from erag.study.compact import nearest
from erag.study.quantconfig import EncoderStudy
from erag.study.searched import Labelled, Report, Way, about, labelled

SIZE, RATE, NEAR, LOWEST = "MB", "texts/s", "cosine to float32", "lowest"
PRECISIONS: Mapping[str, Precision] = {
    "float32": "float32", "bfloat16": "bfloat16", "int8 weights": "int8", "int8 products": "int8_products"
}  # fmt: skip
_SPEED_TEXTS = 128
_FOUND = 5


def run(config: EncoderStudy, store: ModelStore, progress: Progress = quiet) -> Report:
    """Measure each precision and write the table. Raises ModelError for a model that is no plain BERT."""
    go_offline()
    folder, data = store.path(config.model), labelled(config)
    if not is_plain_bert(folder):
        raise ModelError("is no plain BERT", where=f"model {config.model}", allowed="a sentence-transformers BERT")
    ways: list[Way] = []
    exact: Vectors | None = None
    for done, (name, precision) in enumerate(PRECISIONS.items()):
        progress("precisions", done, len(PRECISIONS))
        embedder = SentenceEmbedder(SentenceConfig(model=config.model, dtype=precision), store)
        vectors = embedder.embed([*data.texts, *data.said()], "document")
        exact = vectors if exact is None else exact  # the first one is float32
        ways.append(_way(name, embedder, vectors, exact, data, _megabytes(folder, precision)))
    progress("precisions", len(PRECISIONS), len(PRECISIONS))
    told = f"{about(config, data)} Word embeddings stay float32 with int8."
    columns = {SIZE: ".1f", RATE: ".0f", NEAR: ".5f", LOWEST: ".4f"}
    report = Report(f"{config.model} in other precisions", told, columns, tuple(ways))
    report.write(config.out)
    return report


def _way(
    name: str, embedder: SentenceEmbedder, vectors: Vectors, exact: Vectors, data: Labelled, megabytes: float
) -> Way:
    near = (vectors * exact).sum(axis=1)
    nodes, queries = vectors[: len(data.ids)], vectors[len(data.ids) :]
    values = {SIZE: megabytes, RATE: _rate(embedder, data), NEAR: float(near.mean()), LOWEST: float(near.min())}
    return Way.of(name, values, [nearest(nodes @ query, _FOUND) for query in queries], data)


def _rate(embedder: SentenceEmbedder, data: Labelled) -> float:
    some = list(data.texts[:_SPEED_TEXTS])
    start = time.perf_counter()
    embedder.embed(some, "document")
    return len(some) / (time.perf_counter() - start)


def _megabytes(folder: Path, precision: Precision) -> float:
    if precision == "int8" or precision == "int8_products":
        return Int8Encoder(folder, precision).nbytes / 1e6
    return BertEncoder(folder, getattr(torch, precision)).nbytes / 1e6
