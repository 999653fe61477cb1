"""Hits to an answer: where to go and why, or a text; waypoints, routes and numbers always by code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from erag.aware.past import Past
from erag.core.types import Answer, Hit, Pose, Query, QueryKind, Route, Waypoint
from erag.forest.support import Evidence
from erag.generate.asking import borne_out, explain_prompt, read, reason_prompt
from erag.generate.config import AnswerConfig
from erag.generate.focus import Focus, counts
from erag.generate.kind import decide_kind
from erag.generate.memories import Recalled
from erag.generate.overview import Overview
from erag.generate.region import Regions
from erag.generate.scope import Scope, Scopes
from erag.generate.sufficiency import Sufficiency
from erag.generate.telling import Told
from erag.generate.views import View, Views
from erag.lm.ledger import Ledger
from erag.lm.roles import Vectors, Writer
from erag.retrieve.corpus import Corpus
from erag.retrieve.named import names_what_it_wants

NOTHING = "Not in this memory."
_AGAIN = 2  # views of a second try, where nothing is left of the first: fewer leave less to mix up
RECALLED = 5  # views that an answer about the past names as its evidence
Eligible = npt.NDArray[np.bool_]


class Routes(Protocol):
    """What an answer needs of a router."""

    def route(self, start: Pose | str | None, goal: str) -> Route:
        """The shortest way from a pose or a node to a node."""
        ...


class Answerer:
    """Answers over one corpus.

    `writer` writes what the configuration leaves to a language model; `past` lends what it knows of things and places.
    """

    def __init__(
        self,
        corpus: Corpus,
        routes: Routes,
        config: AnswerConfig | None = None,
        writer: Writer | None = None,
        ledger: Ledger | None = None,
        past: Past | None = None,
    ) -> None:
        self._corpus, self._routes, self._writer = corpus, routes, writer
        self._config, self._ledger = config or AnswerConfig(), ledger or Ledger()
        self._past = past or Past(corpus.topomap, corpus.texts, ())
        regions = Regions(corpus, routes, self._past.things, self._past.sight)
        self._scopes, self._enough, self._views = Scopes(corpus, regions), Sufficiency(corpus), Views(corpus)
        self._focus = Focus(corpus, lambda texts: self._writing.embed(texts, "document"))

    def answer(
        self,
        query: Query,
        vector: Vectors,
        hits: tuple[Hit, ...],
        eligible: Eligible,
        probability: float | None = None,
    ) -> Answer:
        """The answer to `query`, whose text has the vector (d,), from its hits, best first.

        `eligible` (n,) are the nodes that may answer it; `probability` is that of the most relevant one, where known.
        Raises BadModelOutput for a text that is not of its schema.
        """
        return self.answer_scoped(query, vector, hits, eligible, probability)[0]

    def answer_scoped(
        self,
        query: Query,
        vector: Vectors,
        hits: tuple[Hit, ...],
        eligible: Eligible,
        probability: float | None = None,
    ) -> tuple[Answer, Told | None]:
        """The answer as `answer` gives it, and what an explanation speaks of."""
        kind = decide_kind(query)
        if not hits:
            return Answer(kind, NOTHING, reason="no observation fits the question and its conditions"), None
        if query.text is not None and self._too_little(kind, query.text, vector, eligible, probability):
            return Answer(kind, NOTHING, reason="nothing that was seen comes near to what is asked for"), None
        if kind == "find":
            return self._find(query, vector, hits), None
        scope = self._scopes.of(query, hits, eligible)
        parts = self._scopes.parts(scope, self._overview.name)
        told = self._overview.told(query.text or "", scope.rows, parts) if self._config.overview else ""
        answer = self._told(told, vector, scope) if told else self._explain(query, vector, hits, scope)
        return answer, Told(scope.rows, parts)

    @cached_property
    def _overview(self) -> Overview:
        return Overview(self._focus.words, self._corpus.texts, self._past.things, self._past.visits)

    def _told(self, told: str, vector: Vectors, scope: Scope) -> Answer:
        """An explanation that code tells alone, with the views that come closest to the question."""
        views = self._views.of(vector, scope.rows, self._config.quoted)
        return self._explained(told, views, f"counted over {len(scope.rows):,} views of {scope.name}")

    def recalled(self, query: Query, vector: Vectors, found: Recalled) -> Answer:
        """The answer from what a memory knows of times, changes and numbers; with a way to the place one asked for."""
        ids = tuple(self._corpus.topomap.nodes[row].id for row in found.rows)
        if found.kind != "find" or not ids:
            views = [v for visit in found.beside for v in self._views.of(vector, visit.rows, self._config.quoted)]
            told = self._explained(found.text, views, found.reason)
            return replace(told, evidence=tuple(dict.fromkeys((*ids[:RECALLED], *told.evidence))))
        node = self._corpus.topomap.nodes[found.rows[0]]
        route = self._routes.route(query.at, node.id) if query.at is not None else Route("no_start")
        waypoint = Waypoint(node.id, self._corpus.topomap.frame, node.pose.xyz, node.pose.yaw)
        return Answer("find", f"{found.text} Go to {node.id}{_way(route)}.", found.reason, waypoint, route, ids[:1])

    def too_little(self, query: Query, vector: Vectors, eligible: Eligible, probability: float | None = None) -> bool:
        """Whether the nodes `eligible` (n,) hold too little that comes near to a query with the vector (d,)."""
        return query.text is not None and self._too_little("find", query.text, vector, eligible, probability)

    def _too_little(
        self, kind: QueryKind, text: str, vector: Vectors, eligible: Eligible, probability: float | None
    ) -> bool:
        if kind == "find" and probability is not None:
            by_name = names_what_it_wants(text) and not self._enough.mentioned(text, eligible)
            return probability < (self._config.least_named if by_name else self._config.least_probability)
        least = self._config.least_evidence if kind == "find" else self._config.least_explained
        return least > 0 and self._enough.evidence(text, vector, eligible) < least

    def _find(self, query: Query, vector: Vectors, hits: Sequence[Hit]) -> Answer:
        best = hits[0]
        row = self._corpus.topomap.row[best.node]
        node = self._corpus.topomap.nodes[row]
        route = self._routes.route(query.at, best.node) if query.at is not None else Route("no_start")
        label = f"{best.node} ({node.name})" if node.name and node.name != best.node else best.node
        text = f"Go to {label}{_way(route)}."
        waypoint = Waypoint(best.node, self._corpus.topomap.frame, best.position, node.pose.yaw)
        return Answer("find", text, self._reason(query, row, vector), waypoint, route, (best.node,))

    def _reason(self, query: Query, row: int, vector: Vectors) -> str:
        if query.text is None:
            return "the nearest place that " + ("fits the readings best" if query.sensors else "the memory knows")
        quote = f'it was described as: "{self._corpus.quote(row, vector)}"'
        if self._config.reason == "quote":
            return quote
        view = self._corpus.texts[row]
        (written,) = self._writing.generate([reason_prompt(query.text, view, self._config.reason_chars)])
        said, removed = borne_out(read(written.text, "reason"), Evidence.of_texts([view]))
        self._count("unsupported sentences of answers removed", removed)
        self._count("reasons quoted instead of written", not said)
        return f"{said} {quote[:1].upper()}{quote[1:]}" if said else quote

    def _explain(self, query: Query, vector: Vectors, hits: tuple[Hit, ...], scope: Scope) -> Answer:
        if self._config.explain == "written" and query.text is not None:
            return self._written(query.text, vector, scope)
        rows = [self._corpus.topomap.row[hit.node] for hit in hits]
        views = [View(self._corpus.quote(row, vector), row) for row in rows]
        reason = f"what {len(views)} of {int(self._corpus.searchable.sum()):,} views say"
        return self._explained("", views, reason)

    def _written(self, text: str, vector: Vectors, scope: Scope) -> Answer:
        """What the generator says of views and counts, less what no view bears out; then counts and quotes by code."""
        config = self._config
        facts = self._focus.facts(vector, scope.rows, config.facts, config.least_share)
        views, counted = self._views.of(vector, scope.rows, config.views), counts(facts)
        evidence = Evidence(self._focus.words, scope.rows, facts)
        said = self._said(text, views, counted, evidence) or self._said(text, views[:_AGAIN], counted, evidence)
        self._count("explanations told by views and numbers alone", not said)
        told = " ".join(filter(None, (said, counted)))
        return self._explained(told, views[: config.quoted], f"from {len(scope.rows):,} views of {scope.name}")

    def _said(self, text: str, views: Sequence[View], counted: str, evidence: Evidence) -> str:
        """What is left of the generator's answer to a question; nothing where the evidence bears out none of it."""
        prompt = explain_prompt(text, [view.text for view in views], counted.rstrip("."), self._config.explain_chars)
        (written,) = self._writing.generate([prompt])
        said, removed = borne_out(read(written.text, "answer"), evidence)
        self._count("unsupported sentences of answers removed", removed)
        return said

    def _explained(self, said: str, views: Sequence[View], reason: str) -> Answer:
        ids = tuple(self._corpus.topomap.nodes[view.row].id for view in views)
        quotes = (f'[{node}] "{view.text}"' for node, view in zip(ids, views, strict=True))
        return Answer("explain", "\n".join(filter(None, (said, *quotes))), reason, evidence=tuple(dict.fromkeys(ids)))

    @property
    def _writing(self) -> Writer:
        if self._writer is None:
            raise ValueError("this configuration asks a language model, and the answerer was given none")
        return self._writer

    def _count(self, event: str, times: int) -> None:
        if times:
            self._ledger.events[event] += times


def _way(route: Route) -> str:
    if route.status == "ok" and route.length_m is not None:
        over = f", {route.bridges} of its edges bridged, not driven" if route.bridges else ""
        return f", {route.length_m:.0f} m along the map{over}"
    return {"unreachable": "; no way there is on the map", "off_map": "; the start is off the map"}.get(
        route.status, ""
    )
