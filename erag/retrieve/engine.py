"""Queries to hits: the retriever that is asked, restricted by time, re-ranked by location and sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from erag.core.errors import ConfigError, InputError
from erag.core.geometry import spatial_similarity
from erag.core.types import Frame, Hit, IntArray, Pose, Query, Range
from erag.lm.roles import LMBackend, Vectors
from erag.retrieve.config import Bm25Config, RetrieveConfig, TreeConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.expand import Expander
from erag.retrieve.places import spread
from erag.retrieve.rank import Distances, Floats, Nearness, Sensors, StraightLines, Times, auto_theta, blend, mean_known
from erag.retrieve.relevance import RelevanceScorer
from erag.retrieve.rescore import Rescorer
from erag.retrieve.scoring import Batch, Mask, Reached, Search, best_first
from erag.retrieve.searches import asks_models, conditions_of, scorer_of, search_of
from erag.retrieve.tree import ClusterJudge

_BLOCK = 32  # queries searched at once: bounds the memory of (queries, nodes) arrays


@dataclass(frozen=True, slots=True)
class Found:
    """Hits, best first and unique; how many tree nodes and leaves were scored; what a user should know about it.

    `probability` is that of the most relevant node, wherever it is; None where the retriever's scores are none.
    """

    hits: tuple[Hit, ...]
    visited: int = 0
    notes: tuple[str, ...] = ()
    probability: float | None = None


@dataclass(frozen=True, slots=True)
class _Ranked:
    """Hits in final order: rows (r,), scores (r,), parts (r,) or None, and whether metres are along edges (r,).

    `left_out`: how many nodes gave way to other places, being further views of places that are hits.
    """

    rows: IntArray
    score: Floats
    semantic: Floats | None
    spatial: Floats | None
    sensor: Floats | None
    on_edges: Mask | None
    left_out: int


@dataclass(frozen=True, slots=True)
class _Way:
    """From where a query is asked to every node: metres (n,), whether along edges (n,), spatial similarity (n,)."""

    metres: Floats
    on_edges: Mask
    spatial: Floats


@dataclass(frozen=True, slots=True)
class _Read:
    """What was reached for a query, and what else was searched for."""

    reached: Reached
    things: tuple[str, ...] = ()
    conditions: str = ""


class Retriever:
    """Answers queries over one corpus. Indexes are made once, here.

    `router` measures distances (straight lines without one), `sensors` holds the declared range of each channel;
    `backend` plays the roles a configuration gives to language models. `judge` takes the decisions of a tree instead,
    and `search` finds instead of the configured retriever.
    """

    def __init__(
        self,
        corpus: Corpus,
        config: RetrieveConfig,
        router: Distances | None = None,
        sensors: Mapping[str, Range] | None = None,
        backend: LMBackend | None = None,
        judge: ClusterJudge | None = None,
        search: Search | None = None,
    ) -> None:
        if corpus.forest.leaves != tuple(node.id for node in corpus.topomap.nodes):
            raise ValueError("the leaves of the forest are not the nodes of the map")
        self._corpus, self._config = corpus, config
        if backend is None and asks_models(config):
            raise ConfigError("a language model is asked", where="retrieve", allowed="a backend with its roles")
        scorer = None if search else scorer_of(corpus, config, backend)
        self._nearness = Nearness(config.location_weight, config.form == "product")
        self._located = isinstance(config.retriever, TreeConfig) and config.retriever.located
        nearness = self._nearness if self._located else None
        self._search = search or search_of(corpus, config, backend, judge, scorer, nearness)
        self._conditions = conditions_of(corpus, config, scorer, backend)
        self._expander = Expander(backend, config.expand, corpus.index) if backend and config.expand else None
        self._apart = isinstance(scorer, RelevanceScorer)  # it reads what is named thing by thing, others as one text
        self._rescorer = Rescorer(corpus, backend, config.rescore) if backend and config.rescore else None
        self._distances = router or StraightLines(corpus.topomap)
        self._times, self._sensors = Times.of(corpus.topomap), Sensors(corpus.topomap, sensors or {})
        self._theta = auto_theta(corpus.topomap) if config.theta_rank == "auto" else config.theta_rank

    def retrieve(self, queries: Sequence[Query], vectors: Vectors) -> list[Found]:
        """The hits of each query (paper, phases 1 and 2).

        `vectors` (q, d) are unit rows, zeros for queries without text; with BM25 alone they are not looked at.
        Raises InputError for a query with neither text nor position, a position that cannot be, an unknown sensor
        channel, an empty range or time window, or `top` below 1.
        """
        self._check_vectors(queries, vectors)
        for query in queries:
            _check(query, self._corpus.topomap.frame)
        found: list[Found] = []
        for start in range(0, len(queries), _BLOCK):
            block = slice(start, start + _BLOCK)
            found += self._block(queries[block], vectors[block])
        return found

    def led(self, hits: tuple[Hit, ...], rows: Sequence[int], top: int) -> tuple[Hit, ...]:
        """At most `top` hits: the nodes `rows` in their order, then the others of `hits`; scores fall by place."""
        known = {hit.node: hit for hit in hits}
        nodes = [self._corpus.topomap.nodes[row] for row in rows]
        first = [known.get(n.id) or self._bare(row) for row, n in zip(rows, nodes, strict=True)]
        ids = {hit.node for hit in first}
        ordered = (*first, *(hit for hit in hits if hit.node not in ids))[:top]
        return tuple(replace(hit, score=1 / (place + 1)) for place, hit in enumerate(ordered))

    def _bare(self, row: int) -> Hit:
        node = self._corpus.topomap.nodes[row]
        return Hit(node.id, node.pose.xyz, 1.0, path=self._corpus.forest.path(row))

    def _check_vectors(self, queries: Sequence[Query], vectors: Vectors) -> None:
        if isinstance(self._config.retriever, Bm25Config) or not self._corpus.searchable.any():
            return
        expected = (len(queries), self._corpus.node_vectors.shape[1])
        if vectors.shape != expected:
            raise ValueError(f"query vectors of shape {vectors.shape}, expected {expected}")
        for query, vector in zip(queries, vectors, strict=True):
            if _asks_text(query) and not vector.any():
                raise ValueError(f"the text {query.text!r} came without a vector")

    def _block(self, queries: Sequence[Query], vectors: Vectors) -> list[Found]:
        ways = [None if query.at is None else self._way(query.at) for query in queries]
        spoken = [i for i, query in enumerate(queries) if _asks_text(query)]
        reads = self._reach([queries[i] for i in spoken], vectors[spoken], [ways[i] for i in spoken]) if spoken else []
        read = dict(zip(spoken, reads, strict=True))
        return [self._found(query, way, read.get(i)) for i, (query, way) in enumerate(zip(queries, ways, strict=True))]

    def _way(self, at: Pose) -> _Way:
        metres, on_edges = self._distances.path_or_straight(at, np.arange(len(self._corpus.topomap)))
        return _Way(metres, on_edges, spatial_similarity(metres, self._theta))

    def _reach(self, queries: Sequence[Query], vectors: Vectors, ways: Sequence[_Way | None]) -> list[_Read]:
        if not self._corpus.searchable.any():
            return [_Read(Reached(np.empty(0, np.int64), np.empty(0, np.float32), 0)) for _ in queries]
        batch = Batch(tuple(query.text or "" for query in queries), vectors, spatial=self._spatial(ways))
        eligible = np.stack([self.eligible(query) for query in queries])
        whole, told = batch, [""] * len(queries)
        things: list[tuple[str, ...]] = [()] * len(queries)
        if self._conditions is not None:
            batch, told = self._conditions.read(batch, [query.kind != "explain" for query in queries])
        if self._expander is not None:
            batch, things = self._expander.expanded(batch, eligible, apart=self._apart)
        found = self._search.search(batch, eligible)
        if self._rescorer is not None:
            found = self._rescorer.rescored(whole, found, max(query.top for query in queries))
        return [_Read(*parts) for parts in zip(found, things, told, strict=True)]

    def _spatial(self, ways: Sequence[_Way | None]) -> Floats | None:
        """(q, n), NaN where no place is known; None where none is, and for searches that do not look at it."""
        if not self._located or not any(ways):
            return None
        unknown = np.full(len(self._corpus.topomap), np.nan)
        return np.stack([unknown if way is None else way.spatial for way in ways])

    def _askable(self, query: Query) -> Mask:
        """(n,) bool: nodes with what the query looks at, whenever they were observed."""
        return self._corpus.searchable if _asks_text(query) else self._corpus.visible

    def eligible(self, query: Query) -> Mask:
        """(n,) bool: nodes that may be a hit of the query: with a text, and inside its time window."""
        if not _asks_time(query):
            return self._askable(query)
        return self._askable(query) & self._times.within(query.since, query.until, query.hours)

    def _found(self, query: Query, way: _Way | None, read: _Read | None) -> Found:
        if read is None:
            rows = np.flatnonzero(self.eligible(query))
            ranked, visited = self._rank(query, way, rows, None), len(rows)
        else:
            rows, scores = self._pooled(read.reached, self._config.ranked(query.top, sensed=bool(query.sensors)))
            ranked, visited = self._rank(query, way, rows, scores), read.reached.visited
        hits = tuple(self._hit(ranked, i) for i in range(len(ranked.rows)))
        looked = [f"also looked for: {', '.join(read.things)}"] if read and read.things else []
        set_out = [f"conditions: {read.conditions}"] if read and read.conditions else []
        notes = (*set_out, *looked, *self._map_notes(query, bool(hits)), *_hit_notes(query, ranked))
        return Found(hits, visited, notes, self._probability(read))

    def _pooled(self, reached: Reached, most: int | None) -> tuple[IntArray, Floats]:
        """What is ranked again: rows (r,) and scores (r,) of the best `most`, of all where that is None."""
        rows, scores = reached.rows, reached.scores.astype(np.float64)
        if most is None:
            return rows, scores
        best = best_first(reached.scores, rows)[:most]
        return rows[best], scores[best]

    def _probability(self, read: _Read | None) -> float | None:
        if read is None or not self._config.gives_probabilities:
            return None
        best = read.reached.best
        return float(read.reached.scores.max(initial=0.0)) if best is None else best

    def _rank(self, query: Query, way: _Way | None, rows: IntArray, semantic: Floats | None) -> _Ranked:
        """The best `top` of candidates `rows` (r,); equal scores go by distance, where it counts, then by row."""
        spatial = sensor = on_edges = None
        score, nearness = np.zeros(len(rows)) if semantic is None else semantic, np.zeros(len(rows))
        if way is not None:
            spatial, on_edges = way.spatial[rows], way.on_edges[rows]
            score = spatial if semantic is None else self._nearness.joined(score, spatial)
            nearness = way.metres[rows] if semantic is None or self._nearness.weight > 0 else nearness
        if query.sensors:
            sensor = self._sensor_scores(query)[rows]
            score = blend(score, sensor, self._config.sensor_weight)
        order, left_out = self._chosen(rows, score, best_first(score, nearness, rows), query.top)
        semantic, spatial, sensor = (None if part is None else part[order] for part in (semantic, spatial, sensor))
        on_edges = None if on_edges is None else on_edges[order]
        return _Ranked(rows[order], score[order], semantic, spatial, sensor, on_edges, left_out)

    def _chosen(self, rows: IntArray, score: Floats, order: IntArray, top: int) -> tuple[IntArray, int]:
        """The first `top` of an order (r,), spread over places where that is asked, and how many gave way for it."""
        if self._config.places is None:
            return order[:top], 0
        kept = spread(self._corpus.topomap, rows[order], score[order], top, self._config.places)
        return order[kept], int((kept >= top).sum())

    def _sensor_scores(self, query: Query) -> Floats:
        where = _name(query)
        scores = [self._sensors.score(channel, wish, where) for channel, wish in sorted(query.sensors.items())]
        return mean_known(scores, len(self._corpus.topomap))

    def _hit(self, ranked: _Ranked, i: int) -> Hit:
        row = int(ranked.rows[i])
        node = self._corpus.topomap.nodes[row]
        parts = (ranked.semantic, ranked.spatial, ranked.sensor)
        semantic, spatial, sensor = (None if p is None or np.isnan(p[i]) else float(p[i]) for p in parts)
        path = self._corpus.forest.path(row)
        return Hit(node.id, node.pose.xyz, float(ranked.score[i]), semantic, spatial, sensor, path)

    def _map_notes(self, query: Query, any_hits: bool) -> list[str]:
        """Why nothing was found, and what a time window left out."""
        askable, notes = self._askable(query), []
        if _asks_time(query):
            unknown = int((askable & ~self._times.known).sum())
            if unknown:
                notes.append(f"{unknown} nodes of unknown time were left out")
        if any_hits:
            return notes
        if not len(askable):
            reason = "the map is empty"
        elif not askable.any():
            reason = "no node of this map has a text" if _asks_text(query) else "no node of this map shows anything"
        else:
            inside = self.eligible(query).any()
            reason = "no text shares a word with the query" if inside else "nothing was observed in the time window"
        return [*notes, reason]


def _asks_text(query: Query) -> bool:
    return bool(query.text and query.text.strip())


def _asks_time(query: Query) -> bool:
    return query.since is not None or query.until is not None or query.hours is not None


def _name(query: Query) -> str:
    return f"query {query.id}" if query.id else "the query"


def _check(query: Query, frame: Frame) -> None:
    if query.top < 1:
        raise InputError(f"top is {query.top}", where=_name(query), allowed="at least 1")
    if not _asks_text(query) and query.at is None:
        raise InputError("neither a text nor a position", where=_name(query), allowed="query, at, or both")
    if query.at is not None and frame is Frame.WGS84 and (abs(query.at.y) > 90 or abs(query.at.x) > 180):
        at = f"longitude {query.at.x}, latitude {query.at.y}"
        raise InputError(at, where=_name(query), allowed="longitude, latitude within ±180, ±90")
    if query.since is not None and query.until is not None and query.since > query.until:
        raise InputError(f"since {query.since} > until {query.until}", where=_name(query), allowed="since <= until")


def _hit_notes(query: Query, ranked: _Ranked) -> list[str]:
    """What the scores of the hits rest on where that is not what one would expect."""
    shown, notes = len(ranked.rows), []
    straight = 0 if ranked.on_edges is None else int((~ranked.on_edges).sum())
    if straight:
        notes.append(f"{straight} of {shown} distances are straight lines, not along edges of the map")
    unread = 0 if ranked.sensor is None else int(np.isnan(ranked.sensor).sum())
    if unread:
        notes.append(f"{unread} of {shown} hits have no reading of {', '.join(sorted(query.sensors))}")
    if ranked.left_out:
        notes.append(f"left out for other places: {ranked.left_out} further views of these")
    return notes
