"""What a query costs from hundreds to hundreds of thousands of nodes: vectors scored, tree nodes opened, seconds."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

from erag.bench.balanced import balanced_forest
from erag.bench.config import ScalingBench
from erag.bench.maps import Asked, Town, ground_phrases, questions, thing_phrases, town
from erag.bench.memory import peak_mb
from erag.core.types import IntArray, Query
from erag.forest.build import build_forest
from erag.lm.config import build_backend
from erag.lm.roles import LMBackend, Vectors
from erag.lm.weights import ModelStore, default_store
from erag.pipeline.config import validate
from erag.retrieve.config import RetrieveConfig, TreeConfig
from erag.retrieve.corpus import Corpus, map_texts
from erag.retrieve.engine import Retriever
from erag.retrieve.scoring import Batch, Search
from erag.retrieve.searches import leaf_scorer, search_of
from erag.retrieve.tree import Choice, ClusterJudge, TreeSearch

_COLOURS = ("#1f3a5f", "#b0552b", "#2a8a4a", "#8a5fa8", "#777777")


@dataclass(frozen=True, slots=True)
class Row:
    """A retriever on a map of `nodes` places, all figures a query.

    `vectors` of the map that were compared with the query and tree nodes `opened`, on average; `median` and `p95`
    seconds from the query's vector to its hits; `right`, the share of first hits that show what was asked for; seconds
    of making the `index`. Of the whole measurement of a map: `peak_mb` of its process and who made the `forest`.
    """

    nodes: int
    retriever: str
    vectors: float
    opened: float
    median: float
    p95: float
    right: float
    index: float
    peak_mb: float
    forest: str


@dataclass(frozen=True)
class Phrases:
    """Vectors of what captions are composed of."""

    things: Vectors
    grounds: Vectors


@dataclass
class Tally:
    """Counts what a descent judges and opens; decisions are those of the judge it stands for."""

    leaves: int
    judged: int = 0
    opened: int = 0
    judge: ClusterJudge | None = field(default=None, repr=False)

    def __call__(self, judge: ClusterJudge) -> ClusterJudge:
        """Stand for `judge`."""
        self.judge = judge
        return self

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        """See `ClusterJudge`."""
        assert self.judge is not None  # noqa: S101
        chosen = self.judge.choose(batch, choices, k)
        self.judged += sum(int((choice.rows >= self.leaves).sum()) for choice in choices)
        self.opened += sum(int((rows >= self.leaves).sum()) for rows in chosen)
        return chosen


def run(config: ScalingBench, store: ModelStore) -> Iterator[Row]:
    """The rows of each size, which is measured in a process of its own."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    backend = build_backend(config.pipeline.backend, store)
    phrases = Phrases(*(backend.embed(texts, "document") for texts in (thing_phrases(), ground_phrases())))
    for nodes in config.sizes:
        asked = questions(town(nodes, config.seed), config.queries, config.seed)
        vectors = backend.embed([a.text for a in asked], "query")
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            yield from pool.submit(measured, config, nodes, phrases, vectors).result()


def measured(config: ScalingBench, nodes: int, phrases: Phrases, vectors: Vectors) -> list[Row]:
    """The rows of one size; `vectors` (q, d) are those of its questions."""
    places = town(nodes, config.seed)
    asked = questions(places, config.queries, config.seed)
    corpus, forest = _corpus(places, phrases, config.built_up_to)
    backend = build_backend(config.pipeline.backend, default_store())
    rows = [
        replace(_measured(corpus, _retrieve(config, name), backend, _Asking(asked, vectors, places, config.repeats)),
                retriever=name, forest=forest)
        for name in config.retrievers
    ]  # fmt: skip
    return [replace(row, peak_mb=peak_mb()) for row in rows]


def _retrieve(config: ScalingBench, name: str) -> RetrieveConfig:
    return validate(
        RetrieveConfig, {**config.pipeline.retrieve.model_dump(), **config.retrievers[name]}, f"retrievers.{name}"
    )


def _corpus(places: Town, phrases: Phrases, built_up_to: int) -> tuple[Corpus, str]:
    topomap, (nodes, spoken) = places.topomap(), places.vectors(phrases.things, phrases.grounds)
    built = len(topomap) <= built_up_to
    forest = build_forest(topomap, nodes)[0] if built else balanced_forest(topomap, nodes)
    summaries = np.zeros((len(forest.clusters), nodes.shape[1]), np.float32)
    sentence_rows = np.repeat(np.arange(len(topomap), dtype=np.int64), 2)
    corpus = Corpus(topomap, forest, map_texts(topomap), nodes, spoken, sentence_rows, summaries)
    return corpus, "built" if built else "balanced"


@dataclass(frozen=True)
class _Asking:
    """What is asked, and how often."""

    asked: Sequence[Asked]
    vectors: Vectors
    places: Town
    repeats: int


def _measured(corpus: Corpus, config: RetrieveConfig, backend: LMBackend, asking: _Asking) -> Row:
    start = time.perf_counter()
    tally = Tally(len(corpus.topomap))
    retriever = Retriever(corpus, config, search=_search(corpus, config, backend, tally))
    index = time.perf_counter() - start
    order = list(islice(cycle(range(len(asking.asked))), len(asking.asked) * asking.repeats))
    retriever.retrieve([Query(asking.asked[-1].text)], asking.vectors[-1:])  # caches and lazily imported modules
    tally.judged = tally.opened = 0
    seconds, right, visited = [], 0, 0
    for i in order:
        start = time.perf_counter()
        (found,) = retriever.retrieve([Query(asking.asked[i].text)], asking.vectors[i : i + 1])
        seconds.append(time.perf_counter() - start)
        visited += found.visited
        first = corpus.topomap.row[found.hits[0].node] if found.hits else None
        right += first is not None and asking.asked[i].right(asking.places.things[first].tolist())
    return Row(
        len(corpus.topomap),
        "",
        _vectors(corpus, visited / len(order), tally.judged / len(order)),
        tally.opened / len(order),
        float(np.median(seconds)),
        float(np.quantile(seconds, 0.95)),
        right / len(order),
        index,
        0.0,
        "",
    )


def _vectors(corpus: Corpus, visited: float, judged: float) -> float:
    """Vectors compared a query: a scan takes every node's and sentence's, a mere descent what it visits."""
    if visited >= len(corpus.topomap):
        return len(corpus.node_vectors) + len(corpus.sentence_vectors) + judged
    return visited


def _search(corpus: Corpus, config: RetrieveConfig, backend: LMBackend, tally: Tally) -> Search:
    kind = config.retriever
    if isinstance(kind, TreeConfig):
        return TreeSearch(corpus, kind, leaf_scorer(corpus, kind.scores, backend), tally)
    return search_of(corpus, config, backend)


def columns(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The measurements as a table: names of columns, and cells."""
    names = ("nodes", "retriever", "vectors", "opened", "median ms", "95 % ms", "right", "index s", "peak MB", "forest")
    cells: list[tuple[str, ...]] = [
        (
            f"{r.nodes:,}",
            r.retriever,
            f"{r.vectors:,.0f}",
            f"{r.opened:.1f}",
            f"{1000 * r.median:.1f}",
            f"{1000 * r.p95:.1f}",
            f"{r.right:.2f}",
            f"{r.index:.1f}",
            f"{r.peak_mb:,.0f}",
            r.forest,
        )
        for r in rows
    ]
    return names, cells


def plotted(rows: Sequence[Row], path: Path) -> bool:
    """Draw vectors, opened nodes and seconds over nodes, a line a retriever; whether there was matplotlib for it."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)
    _panel(panels[0], rows, "vectors compared a query", [r.vectors for r in rows])
    _panel(panels[1], rows, "tree nodes opened a query", [r.opened for r in rows])
    _panel(panels[2], rows, "seconds a query: median, 95 %", [r.median for r in rows], [r.p95 for r in rows])
    handles, names = panels[2].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, metadata={"Software": None})
    return True


def _panel(
    axes: Any, rows: Sequence[Row], title: str, values: Sequence[float], upper: Sequence[float] | None = None
) -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    for (name, mark), colour in zip(_lines(rows), cycle(_COLOURS), strict=False):
        own = [i for i, r in enumerate(rows) if r.retriever == name and values[i] > 0]
        x = [rows[i].nodes for i in own]
        axes.plot(x, [values[i] for i in own], mark, color=colour, markersize=5, linewidth=1.2, label=name)
        if upper is not None:
            axes.fill_between(
                x, [values[i] for i in own], [upper[i] for i in own], color=colour, alpha=0.15, linewidth=0
            )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda nodes, _: f"{nodes:,.0f}"))
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("nodes of the map", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(which="major", color="#e4e4e4", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)


def _lines(rows: Sequence[Row]) -> Iterator[tuple[str, str]]:
    """Retrievers with their marks; lines that lie on each other stay visible."""
    return zip(dict.fromkeys(r.retriever for r in rows), cycle(("o-", "s--", "^:", "D-.", "v-")), strict=False)
