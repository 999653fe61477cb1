"""What fewer bytes for vectors cost: found again, P@k on labelled queries, bytes and milliseconds."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from erag.core.progress import Progress, quiet
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, bootstrap
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.sentence import SentenceEmbedder
from erag.lm.weights import ModelStore
from erag.study.compact import Kept, kept
from erag.study.quantconfig import VectorStudy
from erag.study.searched import Report, Way, about, labelled
from erag.study.vectors import KeptVectors

EACH, TIME, AGAIN = "bytes each", "ms a query", "ten nearest found again"
_FOUND = 10


def run(config: VectorStudy, store: ModelStore, progress: Progress = quiet) -> Report:
    """Measure each way and write the table."""
    go_offline()
    data = labelled(config)
    embed = KeptVectors(SentenceEmbedder(config.embedder, store), config.out / "vectors")
    nodes, queries = embed(data.texts), embed(data.said())
    ways, exact, measured = _ways(nodes, config.pools), list[IntArray](), list[Way]()
    for done, (name, way) in enumerate(ways.items()):
        progress("ways", done, len(ways))
        found = [way.nearest(query, _FOUND) for query in queries]
        exact = exact or found  # the first way is float32
        again = [len(np.intersect1d(f, e)) / len(e) for f, e in zip(found, exact, strict=True)]
        values: dict[str, float | Interval] = {
            EACH: way.bytes / len(nodes), TIME: _milliseconds(way, queries, config.repeats), AGAIN: bootstrap(again)
        }  # fmt: skip
        measured.append(Way.of(name, values, found, data))
    progress("ways", len(ways), len(ways))
    told = f"{about(config, data)} One vector a node."
    report = Report("Vectors in fewer bytes", told, {EACH: ".0f", TIME: ".3f", AGAIN: ""}, tuple(measured))
    report.write(config.out)
    return report


def _ways(nodes: Vectors, pools: Sequence[int]) -> dict[str, Kept]:
    """The forms of the vectors, float32 first."""
    whole: dict[str, Kept] = {form: kept(nodes, form) for form in ("float32", "float16", "int8", "bits")}
    return whole | {f"bits, then int8 of {pool}": kept(nodes, "rescored", pool) for pool in pools}


def _milliseconds(way: Kept, queries: Vectors, repeats: int) -> float:
    """The median over repeats of a query's mean time."""
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        for query in queries:
            way.nearest(query, _FOUND)
        taken.append((time.perf_counter() - start) / len(queries))
    return float(np.median(taken)) * 1000
