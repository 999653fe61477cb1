"""Hits to an answer, by code alone: where to go, how to get there, and what was seen, quoted."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from erag.core.text import sentences, words
from erag.core.types import Answer, Hit, Pose, Query, QueryKind, Route, Waypoint
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus

NOTHING = "Not in this memory."
QUOTED = 5  # places an explanation quotes
_EXPLAIN_WORDS = frozenset({"what", "which", "how", "why", "describe", "explain", "summarise", "summarize", "compare"})
_FIND_PAIRS = (("where", "is"), ("where", "are"), ("where", "can"), ("where", "could"), ("take", "me"), ("i", "want"))


class Routes(Protocol):
    """What an answer needs of a router."""

    def route(self, start: Pose | None, goal: str) -> Route:
        """The shortest way from a pose to a node."""
        ...


def decide_kind(query: Query) -> QueryKind:
    """`query.kind`, or where it is absent what its words ask for: a place to go, or a text."""
    if query.kind is not None:
        return query.kind
    spoken = words(query.text or "")
    if not spoken or any(pair in pairwise(spoken) for pair in _FIND_PAIRS):
        return "find"
    return "explain" if spoken[0] in _EXPLAIN_WORDS else "find"


class Answerer:
    """Answers over one corpus."""

    def __init__(self, corpus: Corpus, routes: Routes) -> None:
        self._corpus, self._routes = corpus, routes

    def answer(self, query: Query, vector: Vectors, hits: Sequence[Hit]) -> Answer:
        """The answer to `query`, whose text has the vector (d,), from its hits, best first."""
        kind = decide_kind(query)
        if not hits:
            return Answer(kind, NOTHING, reason="no observation fits the question and its conditions")
        if kind == "explain":
            return self._explain(vector, hits)
        return self._find(query, vector, hits)

    def _find(self, query: Query, vector: Vectors, hits: Sequence[Hit]) -> Answer:
        best = hits[0]
        row = self._corpus.topomap.row[best.node]
        node = self._corpus.topomap.nodes[row]
        route = self._routes.route(query.at, best.node) if query.at is not None else Route("no_start")
        label = f"{best.node} ({node.name})" if node.name and node.name != best.node else best.node
        text = f"Go to {label}{_way(route)}."
        waypoint = Waypoint(best.node, self._corpus.topomap.frame, best.position, node.pose.yaw)
        return Answer("find", text, self._reason(query, row, vector), waypoint, route, (best.node,))

    def _explain(self, vector: Vectors, hits: Sequence[Hit]) -> Answer:
        quoted = hits[:QUOTED]
        lines = [f"[{h.node}] {self._quote(self._corpus.topomap.row[h.node], vector)}" for h in quoted]
        reason = f"what {len(quoted)} of {int(self._corpus.searchable.sum())} views say"
        return Answer("explain", "\n".join(lines), reason, evidence=tuple(h.node for h in quoted))

    def _reason(self, query: Query, row: int, vector: Vectors) -> str:
        if query.text is None:
            return "the nearest place that " + ("fits the readings best" if query.sensors else "the memory knows")
        return f'it was described as: "{self._quote(row, vector)}"'

    def _quote(self, row: int, vector: Vectors) -> str:
        """The sentence of a node that comes closest to the question."""
        spoken = sentences(self._corpus.texts[row])
        first, last = np.searchsorted(self._corpus.sentence_rows, [row, row + 1])
        if not spoken or len(spoken) != last - first:
            return self._corpus.texts[row]
        return spoken[int((self._corpus.sentence_vectors[first:last] @ vector).argmax())]


def _way(route: Route) -> str:
    if route.status == "ok" and route.length_m is not None:
        over = f", {route.bridges} of its edges bridged, not driven" if route.bridges else ""
        return f", {route.length_m:.0f} m along the map{over}"
    return {"unreachable": "; no way there is on the map", "off_map": "; the start is off the map"}.get(
        route.status, ""
    )
