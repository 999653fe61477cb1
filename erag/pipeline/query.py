"""Queries over a built memory: one at a time, or a file of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from erag.core.errors import InputError, MemoryFileError
from erag.core.geometry import distance
from erag.core.output import replacing
from erag.core.types import Query
from erag.data.contract import QueryLine, Result, parse_query, result_line
from erag.generate.answer import Answerer
from erag.lm.config import build_backend
from erag.lm.ledger import Ledger
from erag.lm.roles import Vectors
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig
from erag.pipeline.load import Built, load
from erag.retrieve.engine import Retriever
from erag.topomap.routes import Router


class Asker:
    """A memory that answers: its corpus, retriever, routes and models, loaded once."""

    def __init__(self, path: Path, config: PipelineConfig, store: ModelStore) -> None:
        self.path = path
        built = load(path)
        self.ledger, self._warm = Ledger(), False
        self._backend = build_backend(config.backend, store, self.ledger)
        _check_embedder(path, built, self._backend.identity("embed"))
        self.corpus, self.notes = built.corpus, built.stale
        router = Router(self.corpus.topomap)
        self._retriever = Retriever(self.corpus, config.retrieve, router, built.sensors)
        self._answerer = Answerer(self.corpus, router)

    def ground(self, x: float, y: float) -> float:
        """Height of the node nearest to (x, y): what a position given without a height stands on."""
        topomap = self.corpus.topomap
        flat = topomap.positions * (1, 1, 0)
        return float(topomap.positions[distance(topomap.frame, flat, (x, y, 0)).argmin(), 2])

    def ask(self, query: Query) -> Result:
        """Hits and answer of one query. Raises InputError for a query that cannot be asked of this memory."""
        if query.text is not None and not self._warm:
            self.warm_up()
        start, calls = time.perf_counter(), self.ledger.calls["embed"]
        vector = self._vector(query)
        found = self._retriever.retrieve([query], vector[None, :])[0]
        answer = self._answerer.answer(query, vector, found.hits)
        seconds = time.perf_counter() - start
        made = {"embed": self.ledger.calls["embed"] - calls}
        return Result(query.id, found.hits, answer, seconds, found.visited, made, (*self.notes, *found.notes))

    def ask_lines(self, lines: Iterable[QueryLine], top: int) -> Iterator[Result]:
        """One result a line, in order; a line that cannot be asked has `error` and no hits.

        Raises ModelError when the models cannot be loaded, whatever the lines.
        """
        for line in lines:
            try:
                yield self.ask(parse_query(line, top, self.ground))
            except InputError as error:
                yield Result(line.id, error=error.line())

    def warm_up(self) -> None:
        """Load the models, so that the first query's seconds are those of any other."""
        self._backend.embed(["warm up"], "query")
        self._warm = True

    def _vector(self, query: Query) -> Vectors:
        if query.text is None or not self.corpus.searchable.any():
            return np.zeros(self.corpus.node_vectors.shape[1], np.float32)
        self.ledger.calls["embed"] += 1
        return np.asarray(self._backend.embed([query.text], "query")[0])


def _check_embedder(path: Path, built: Built, identity: str) -> None:
    if built.embedder != identity:
        raise MemoryFileError(
            f"its vectors were made by another embedder ({built.embedder})",
            where=str(path), allowed=identity, repair=f"erag build {path} with this configuration",
        )  # fmt: skip


def write_run(results: Iterable[Result], out: Path | None, line: Callable[[str], None], *inputs: Path) -> int:
    """Write results to the file `out`, complete or not at all, else through `line`. Returns how many have an error.

    Raises InputError when `out` is one of `inputs` or cannot be written.
    """
    if out is None:
        return sum(_written(result, line) for result in results)
    with replacing(out, *inputs) as file:
        return sum(_written(result, lambda text: file.write(text + "\n")) for result in results)


def _written(result: Result, line: Callable[[str], object]) -> bool:
    line(result_line(result))
    return result.error is not None
