"""What fewer bytes for vectors cost: found again, P@k on labelled queries, bytes and milliseconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.text import node_text
from erag.core.types import IntArray
from erag.data.registry import read
from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.labelled import LabelledQuery, read_labelled
from erag.evaluate.statistics import Interval, bootstrap
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.sentence import SentenceEmbedder
from erag.lm.weights import ModelStore
from erag.study.compact import Bits, Eighths, nearest, rescored
from erag.study.quantcard import markdown
from erag.study.quantconfig import EncoderStudy, VectorStudy
from erag.study.shown import Shown
from erag.study.vectors import KeptVectors

Find = Callable[[Vectors], IntArray]  # a query (d,) to the rows found, best first
_FOUND = 10


@dataclass(frozen=True)
class Labelled:
    """Nodes with a text, and queries whose relevant nodes are known."""

    ids: tuple[str, ...]
    texts: tuple[str, ...]
    queries: tuple[LabelledQuery, ...]

    def said(self) -> list[str]:
        """The texts of the queries."""
        return [str((q.line.raw or {})["query"]) for q in self.queries]


@dataclass(frozen=True)
class Way:
    """A way to keep vectors: bytes a vector, milliseconds a query, the ten nearest found again, P@1, P@5."""

    name: str
    bytes: float
    milliseconds: float
    again: Interval
    first: Interval
    five: Interval


@dataclass(frozen=True)
class Report:
    """All ways over n vectors and q queries."""

    nodes: int
    queries: int
    ways: tuple[Way, ...]

    def table(self) -> Shown:
        """The figures for the terminal and the report."""
        header = ("vectors", "bytes each", "ms a query", "ten nearest found again", "P@1", "P@5")
        rows = [
            (w.name, f"{w.bytes:.0f}", f"{w.milliseconds:.3f}", str(w.again), str(w.first), str(w.five))
            for w in self.ways
        ]
        return Shown(header, rows, header[1:3])


def labelled(config: VectorStudy | EncoderStudy) -> Labelled:
    """The nodes and queries of a study. Raises InputError where no node has a text."""
    path = sample_dir() if config.source == "sample" else Path(config.source)
    texts = {o.id: text for o in read(path).observations if (text := node_text(o.name, o.caption))}
    if not texts:
        raise InputError("no node has a text", where=str(path))
    file = sample_queries() if config.queries == "sample" else Path(config.queries)
    asked = [q for q in read_labelled(file, config.where) if (q.line.raw or {}).get("query")]
    return Labelled(tuple(texts), tuple(texts.values()), tuple(asked))


def run(config: VectorStudy, store: ModelStore, progress: Progress = quiet) -> Report:
    """Measure each way and write the table."""
    go_offline()
    data = labelled(config)
    embed = KeptVectors(SentenceEmbedder(config.embedder, store), config.out / "vectors")
    nodes, queries = embed(data.texts), embed(data.said())
    exact = [nearest(nodes @ query, _FOUND) for query in queries]
    kept = _ways(nodes, config.pools)
    ways = []
    for done, (name, (size, find)) in enumerate(kept.items()):
        progress("ways", done, len(kept))
        found, milliseconds = _found(find, queries, config.repeats)
        ways.append(_way(name, size / len(nodes), milliseconds, found, exact, data))
    progress("ways", len(kept), len(kept))
    report = Report(len(nodes), len(queries), tuple(ways))
    (config.out / "report.md").write_text(
        f"# Vectors in fewer bytes\n\n{len(nodes):,} nodes of `{config.source}`, {len(queries)} labelled queries; flat "
        f"search, one vector a node.\n\n{markdown(report.table())}\n",
        encoding="utf-8",
    )
    return report


def _ways(nodes: Vectors, pools: Sequence[int]) -> dict[str, tuple[int, Find]]:
    """Each way's bytes and its search."""
    half, eighths, bits = nodes.astype(np.float16), Eighths.of(nodes), Bits.of(nodes)
    ways: dict[str, tuple[int, Find]] = {
        "float32": (nodes.nbytes, lambda q: nearest(nodes @ q, _FOUND)),
        "float16": (half.nbytes, lambda q: nearest(half.astype(np.float32) @ q, _FOUND)),
        "int8": (eighths.bytes, lambda q: nearest(eighths.scores(q), _FOUND)),
        "bits": (bits.bytes, lambda q: nearest(bits.scores(q), _FOUND)),
    }
    for pool in pools:
        ways[f"bits, then int8 of {pool}"] = (bits.bytes + eighths.bytes, _rescoring(bits, eighths, pool))
    return ways


def _rescoring(bits: Bits, eighths: Eighths, pool: int) -> Find:
    return lambda query: rescored(bits, eighths, query, pool, _FOUND)


def _found(find: Find, queries: Vectors, repeats: int) -> tuple[list[IntArray], float]:
    """What each query finds, and the median milliseconds of one."""
    found, taken = [find(query) for query in queries], []
    for _ in range(repeats):
        start = time.perf_counter()
        for query in queries:
            find(query)
        taken.append((time.perf_counter() - start) / len(queries))
    return found, float(np.median(taken)) * 1000


def _way(
    name: str, size: float, milliseconds: float, found: Sequence[IntArray], exact: Sequence[IntArray], data: Labelled
) -> Way:
    again = [len(np.intersect1d(f, e)) / len(e) for f, e in zip(found, exact, strict=True)]
    hits = [[data.ids[row] in q.relevant for row in rows] for rows, q in zip(found, data.queries, strict=True)]
    first, five = [float(h[0]) for h in hits], [sum(h[:5]) / 5 for h in hits]
    return Way(name, size, milliseconds, bootstrap(again), bootstrap(first), bootstrap(five))
