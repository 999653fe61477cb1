"""A sentence encoder in other precisions: what its vectors and its hits lose, and how fast it is.

This module imports torch; it is itself imported only where the study runs.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as nnf

from erag.core.errors import ModelError
from erag.core.progress import Progress, quiet
from erag.evaluate.statistics import Interval, bootstrap
from erag.lm.bert import BertEncoder, is_plain_bert
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.weights import ModelStore
from erag.study.compact import nearest
from erag.study.quantcard import markdown
from erag.study.quantconfig import EncoderStudy
from erag.study.shown import Shown
from erag.study.vectorstudy import Labelled, labelled

_LEVELS = 127
_BATCH = 32
_SPEED_TEXTS = 128


class Int8Weights(BertEncoder):
    """An encoder whose matrices are int8 with a scale an output; they become float32 again where they are used."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, torch.float32)
        self._small = {name: _rows_to_int8(w) for name, w in self._weights.items() if _is_matrix(name, w)}
        self._weights = {name: w for name, w in self._weights.items() if name not in self._small}

    def _linear(self, x: torch.Tensor, prefix: str) -> torch.Tensor:
        values, scale = self._small[f"{prefix}weight"]
        return nnf.linear(x, values.float() * scale, self._weights[f"{prefix}bias"])

    @property
    def bytes(self) -> int:
        """Bytes of the weights."""
        small = sum(v.nbytes + s.nbytes for v, s in self._small.values())
        return small + sum(w.nbytes for w in self._weights.values())


class Int8Products(Int8Weights):
    """The same, and the inputs of each product become int8 as well, with a scale a row: products of whole numbers."""

    def _linear(self, x: torch.Tensor, prefix: str) -> torch.Tensor:
        multiply: Any = getattr(torch, "_int_mm", None)
        if multiply is None:
            raise ModelError("this torch has no int8 products", allowed="a torch with _int_mm")
        values, scale = self._small[f"{prefix}weight"]
        rows, row_scale = _rows_to_int8(x.reshape(-1, x.shape[-1]))
        product = multiply(rows, values.T).float() * row_scale * scale.T
        found: torch.Tensor = product + self._weights[f"{prefix}bias"]
        return found.view(*x.shape[:-1], -1)


def _is_matrix(name: str, weight: torch.Tensor) -> bool:
    return weight.ndim == 2 and name.startswith("encoder.layer.")


def _rows_to_int8(rows: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """(n, d) int8 and (n, 1) float32."""
    scale = (rows.float().abs().amax(dim=1, keepdim=True) / _LEVELS).clamp_min(1e-12)
    return (rows.float() / scale).round().to(torch.int8), scale


@dataclass(frozen=True)
class Precision:
    """A precision: bytes of the weights, texts a second, cosine to float32 (mean and lowest), P@1, P@5."""

    name: str
    bytes: int
    rate: float
    cosine: float
    lowest: float
    first: Interval
    five: Interval


@dataclass(frozen=True)
class Report:
    """All precisions over n nodes and q queries."""

    nodes: int
    queries: int
    precisions: tuple[Precision, ...]

    def table(self) -> Shown:
        """The figures for the terminal and the report."""
        header = ("precision", "MB", "texts/s", "cosine to float32", "lowest", "P@1", "P@5")
        rows = [
            (p.name, f"{p.bytes / 1e6:.1f}", f"{p.rate:.0f}", f"{p.cosine:.5f}", f"{p.lowest:.4f}", str(p.first),
             str(p.five))
            for p in self.precisions
        ]  # fmt: skip
        return Shown(header, rows, header[1:5])


def run(config: EncoderStudy, store: ModelStore, progress: Progress = quiet) -> Report:
    """Measure each precision and write the table. Raises ModelError for a model that is no plain BERT."""
    go_offline()
    folder, data = store.path(config.model), labelled(config)
    if not is_plain_bert(folder):
        raise ModelError("is no plain BERT", where=f"model {config.model}", allowed="a sentence-transformers BERT")
    whole = BertEncoder(folder, torch.float32)
    exact = _embedded(whole, [*data.texts, *data.said()])
    half, weights, products = BertEncoder(folder, torch.bfloat16), Int8Weights(folder), Int8Products(folder)
    size = sum(w.nbytes for w in whole._weights.values())
    encoders = {
        "float32": (whole, size), "bfloat16": (half, size // 2), "int8 weights": (weights, weights.bytes),
        "int8 products": (products, products.bytes),
    }  # fmt: skip
    found = []
    for done, (name, (encoder, held)) in enumerate(encoders.items()):
        progress("precisions", done, len(encoders))
        found.append(_measured(name, encoder, held, data, exact))
    progress("precisions", len(encoders), len(encoders))
    report = Report(len(data.ids), len(data.queries), tuple(found))
    config.out.mkdir(parents=True, exist_ok=True)
    (config.out / "report.md").write_text(
        f"# {config.model} in other precisions\n\n{len(data.ids):,} nodes of `{config.source}`, {len(data.queries)} "
        f"labelled queries; flat search. Word embeddings stay float32 with int8.\n\n{markdown(report.table())}\n",
        encoding="utf-8",
    )
    return report


def _measured(name: str, encoder: BertEncoder, size: int, data: Labelled, exact: Vectors) -> Precision:
    vectors = _embedded(encoder, [*data.texts, *data.said()])
    near = (vectors * exact).sum(axis=1)
    nodes, queries = vectors[: len(data.ids)], vectors[len(data.ids) :]
    hits = [
        [data.ids[row] in q.relevant for row in nearest(nodes @ v, 5)]
        for v, q in zip(queries, data.queries, strict=True)
    ]
    some = list(data.texts[:_SPEED_TEXTS])
    start = time.perf_counter()
    _embedded(encoder, some)
    rate = len(some) / (time.perf_counter() - start)
    first, five = bootstrap([float(h[0]) for h in hits]), bootstrap([sum(h) / 5 for h in hits])
    return Precision(name, size, rate, float(near.mean()), float(near.min()), first, five)


def _embedded(encoder: BertEncoder, texts: list[str]) -> Vectors:
    """(n, d) unit rows, texts of similar length computed together."""
    ids, _ = encoder.tokenise(texts)
    order = sorted(range(len(ids)), key=lambda i: len(ids[i]))
    out = np.empty((len(ids), encoder.dim), np.float32)
    for start in range(0, len(order), _BATCH):
        rows = order[start : start + _BATCH]
        out[rows] = encoder.encode([ids[i] for i in rows]).numpy()
    return out
