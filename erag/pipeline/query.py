"""Queries over a built memory: one at a time, or a file of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from erag.aware.likeness import Likeness
from erag.aware.past import Past
from erag.aware.reading import Read, Reader
from erag.core.errors import BadModelOutput, InputError, MemoryFileError
from erag.core.geometry import distance
from erag.core.output import replacing
from erag.core.types import Answer, Hit, Query, QueryKind
from erag.data.contract import QueryLine, Result, parse_query, result_line
from erag.generate.answer import Answerer
from erag.generate.kind import decide_kind
from erag.generate.memories import Memories
from erag.generate.telling import Telling
from erag.lm.config import build_backend
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
from erag.lm.replay import NotRecorded
from erag.lm.roles import LMBackend, Prompt, SelectTask, TextKind, Vectors
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig
from erag.pipeline.load import Built, load
from erag.retrieve.config import TreeConfig
from erag.retrieve.engine import Found, Retriever
from erag.retrieve.expand import warming
from erag.topomap.routes import Router


class Asker:
    """A memory that answers: its corpus, retriever, routes and models, loaded once.

    `models` are those of another asker of the same `config.backend`, so that several memories share what is loaded;
    `built` is the memory where it was loaded before.
    """

    def __init__(
        self,
        path: Path,
        config: PipelineConfig,
        store: ModelStore,
        models: Metered | None = None,
        built: Built | None = None,
    ) -> None:
        self.path, self._config = path, config
        built = built or load(path)
        self.models = models or metered(config, store)
        self.ledger, self._backend = self.models.ledger, self.models
        self._warm: set[str] = set()
        _check_embedder(path, built, self._backend.identity("embed"))
        self.corpus, self.notes = built.corpus, built.stale
        router = Router(self.corpus.topomap)
        self._retriever = Retriever(self.corpus, config.retrieve, router, built.sensors, self._backend)
        self._reader = Reader(self.corpus.topomap, built.sensors, config.aware)
        likeness = Likeness(lambda texts: self._backend.embed(texts, "document"))
        past = Past(self.corpus.topomap, self.corpus.texts, self._reader.visits, likeness)
        self._answerer = Answerer(self.corpus, router, config.answer, self._backend, self.ledger, past)
        self._memories = Memories(self.corpus, past)
        names = {channel: self._reader.about(channel) for channel in self._reader.channels}
        self._telling = Telling(self.corpus, self._reader.visits, names, config.aware.stale_after)

    def ground(self, x: float, y: float) -> float:
        """Height of the node nearest to (x, y): what a position given without a height stands on."""
        topomap = self.corpus.topomap
        flat = topomap.positions * (1, 1, 0)
        return float(topomap.positions[distance(topomap.frame, flat, (x, y, 0)).argmin(), 2])

    @property
    def embedder(self) -> LMBackend:
        """The backend that made this memory's vectors."""
        return self._backend

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """(n, d) vectors of texts by the memory's own embedder."""
        return self._backend.embed(texts, kind)

    def ask(self, query: Query) -> Result:
        """Hits and answer of one query.

        Raises InputError for a query that cannot be asked of this memory, BadModelOutput for a model's bad answer.
        """
        if query.text is not None:
            self.warm_up(decide_kind(query))
        start, calls, events = time.perf_counter(), self.ledger.calls.copy(), self.ledger.events.copy()
        read = self._reader.read(query)
        plain = replace(read.query, kind=decide_kind(query))
        vector = self._vector(plain)
        found = self._retriever.retrieve([plain], vector[None, :])[0]
        answer, hits = self._answered(query.text or "", read, plain, vector, found)
        seconds = time.perf_counter() - start
        made = {"embed": 0, **(self.ledger.calls - calls)}
        fallbacks = (f"{event}: {n}" for event, n in sorted((self.ledger.events - events).items()))
        notes = (*self.notes, *read.notes, *found.notes, *fallbacks)
        return Result(query.id, hits, answer, seconds, found.visited, made, notes)

    def _answered(
        self, text: str, read: Read, query: Query, vector: Vectors, found: Found
    ) -> tuple[Answer, tuple[Hit, ...]]:
        """The answer, and the hits with those first that a question about the past rests on."""
        eligible, hits, probability = self._retriever.eligible(query), found.hits, found.probability
        recalled = self._memories.recall(text, read, eligible)
        if recalled is None and hits and not self._answerer.too_little(query, vector, eligible, probability):
            recalled = self._memories.nearest(read, hits)
        if recalled is None:
            answer, scope = self._answerer.answer_scoped(query, vector, hits, eligible, probability)
            return self._telling.told(answer, read, scope), hits
        answer = self._answerer.recalled(query, vector, recalled)
        return self._telling.told(answer, read), self._retriever.led(hits, recalled.rows, query.top)

    def ask_lines(self, lines: Iterable[QueryLine], top: int) -> Iterator[Result]:
        """One result a line, in order; a line that cannot be asked or answered has `error` and no hits.

        Raises ModelError when the models cannot be loaded, whatever the lines.
        """
        for line in lines:
            try:
                yield self.ask(parse_query(line, top, self.ground))
            except (InputError, BadModelOutput) as error:
                yield Result(line.id, error=error.line())

    def warm_up(self, *kinds: QueryKind) -> None:
        """Load the models these kinds of query need, so that the first query's seconds are those of any other."""
        calls, counted = self.ledger.calls.copy(), self.ledger.seconds.copy()
        for call in self._called(*kinds) - self._warm:
            with suppress(NotRecorded):  # records need no warming
                _WARMING[call](self._backend)
            self._warm.add(call)
        self.ledger.calls, self.ledger.seconds = calls, counted

    def _called(self, *kinds: QueryKind) -> set[str]:
        """Which of `_WARMING` queries of these kinds call."""
        retrieve, answer = self._config.retrieve, self._config.answer
        judged = isinstance(retrieve.retriever, TreeConfig) and retrieve.retriever.judge is not None
        written = (answer.reason == "written" and "find" in kinds) or (
            answer.explain == "written" and "explain" in kinds
        )
        called = {
            "embed": True, "expand": retrieve.expand is not None, "generate": written, "select": judged,
            "score": retrieve.rescore is not None,
        }  # fmt: skip
        return {call for call, is_called in called.items() if is_called}

    def _vector(self, query: Query) -> Vectors:
        if query.text is None or not self.corpus.searchable.any():
            return np.zeros(self.corpus.node_vectors.shape[1], np.float32)
        return np.asarray(self._backend.embed([query.text], "query")[0])


def metered(config: PipelineConfig, store: ModelStore) -> Metered:
    """The models of a configuration, none loaded yet, and the ledger that counts what they do."""
    ledger = Ledger()
    return Metered(build_backend(config.backend, store, ledger), ledger)


_WARM = "warm up"
_WARMING: Mapping[str, Callable[[LMBackend], object]] = {
    "embed": lambda backend: backend.embed([_WARM], "query"),
    "expand": lambda backend: backend.generate([warming()]),
    "generate": lambda backend: backend.generate([Prompt((("user", _WARM),), max_tokens=1)]),
    "select": lambda backend: backend.select([SelectTask(_WARM, ("one", "two"))], 1),
    "score": lambda backend: backend.score([(_WARM, "one")]),
}


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
