"""Conditions that a query sets in words, weighed: what is not in the view, near, away from."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from erag.core.geometry import cartesian
from erag.core.types import TopoMap
from erag.forest.terms import fold, mentions, stem
from erag.lm.roles import Embedder
from erag.retrieve.clauses import Clause, Clauses, read_clauses
from erag.retrieve.corpus import Corpus
from erag.retrieve.lexical import LexicalIndex, content, tokens
from erag.retrieve.scoring import Batch, Factors, LeafScorer, Mask, Scores

Floats = npt.NDArray[np.float64]
NAMED = 0.9  # the least probability that a view shows what its text names word for word
SHOWS = 0.5  # a node shows a thing from this share of the map's highest probability on
UNNAMED = 0.4  # what counts of a node's probability that does not name the thing where others do
KNOWN = 0.1  # a map whose highest probability is below this does not know the thing
FLOOR = 0.1  # what is left of a node far from what it should be near
STEPS, LEAST_M, MOST_M = 2.0, 5.0, 50.0  # near is so many spacings of the map's nodes, within these bounds
_APART_M = 0.5  # nodes closer than this stand at one place
_DENIAL = re.compile(r"\b(?:no|not|without|never|neither|nor|cannot|absent|missing|lack\w*|devoid)\b|n['’]t\b", re.I)


class ConditionedScorer:
    """A flat retriever whose scores are multiplied by how well a node meets the conditions of its query."""

    def __init__(self, scorer: LeafScorer) -> None:
        self._scorer = scorer

    def scores(self, batch: Batch) -> Scores:
        """(q, n) in [0, 1]; `NOT_FOUND` where the retriever finds nothing. Untouched without conditions."""
        own = self._scorer.scores(batch)
        if batch.factors is None:
            return own
        by, alone = batch.factors.by, batch.factors.alone[:, None]
        return np.where(own < 0, own, by * np.where(alone, np.float32(1), own)).astype(np.float32)


class Conditions:
    """Reads the conditions of queries and weighs them over one corpus, by the `scorer` of the queries themselves."""

    def __init__(self, corpus: Corpus, scorer: LeafScorer, index: LexicalIndex, embedder: Embedder) -> None:
        self._corpus, self._scorer, self._index, self._embedder = corpus, scorer, index, embedder

    def read(self, batch: Batch, asked: Sequence[bool]) -> tuple[Batch, list[str]]:
        """The batch with what is wanted and the factors of its conditions, and these for people; `asked` (q,): read it.

        A batch without conditions is handed back itself.
        """
        read = [read_clauses(t) if yes else Clauses(t) for t, yes in zip(batch.texts, asked, strict=True)]
        if not any(r.clauses for r in read):
            return batch, [""] * len(batch)
        shown = self._shown(read)
        by = np.stack([self._factor(r.clauses, shown) for r in read])
        alone = np.array([bool(r.clauses) and not r.wanted for r in read])
        told = ["; ".join(self._said(clause, shown) for clause in r.clauses) for r in read]
        return replace(self._wanted(batch, read), factors=Factors(by, alone)), told

    def _wanted(self, batch: Batch, read: Sequence[Clauses]) -> Batch:
        """The batch without the words of conditions; what is nothing but conditions keeps its words."""
        changed = [i for i, r in enumerate(read) if r.clauses and r.wanted]
        if not changed:
            return batch
        texts, vectors = list(batch.texts), batch.vectors.copy()
        for i in changed:
            texts[i] = read[i].wanted
        vectors[changed] = self._embedder.embed([texts[i] for i in changed], "query")
        return replace(batch, texts=tuple(texts), vectors=vectors)

    def _shown(self, read: Sequence[Clauses]) -> dict[str, Floats]:
        """For each thing of all clauses the probability (n,) that a node shows it."""
        things = list(dict.fromkeys(thing for r in read for clause in r.clauses for thing in clause.things))
        scores = self._scorer.scores(Batch(tuple(things), np.asarray(self._embedder.embed(things, "query"))))
        return {thing: self._evident(thing, row) for thing, row in zip(things, scores, strict=True)}

    def _evident(self, thing: str, scores: Scores) -> Floats:
        """Probabilities (n,) corrected by what the texts name, and by what they say is not there."""
        probability = np.maximum(scores, 0).astype(np.float64)
        named = self._naming(thing, probability)
        if named.any():
            probability = np.where(named, np.maximum(probability, NAMED), UNNAMED * probability)
        head = {stem(fold(word)) for word in content(thing)[-1:]}
        for row in np.flatnonzero(self._denying & (probability >= KNOWN)):
            said = mentions(self._corpus.texts[row])
            if head & said.denied_words and not head & said.words:
                probability[row] = 0.0
        return probability

    def _naming(self, thing: str, probability: Floats) -> Mask:
        """(n,) bool: texts that have the words of a thing side by side, or its last one and are probable as well."""
        named = np.zeros(len(probability), np.bool_)
        named[self._index.phrase_rows(tokens(thing))] = True
        head = np.zeros_like(named)
        for word in content(thing)[-1:]:
            head[self._index.rows(word)] = True
        return np.asarray(named | head & (probability >= SHOWS * probability.max(initial=0.0)))

    @cached_property
    def _denying(self) -> Mask:
        """(n,) bool: nodes whose text denies anything."""
        return np.array([_DENIAL.search(text) is not None for text in self._corpus.texts], np.bool_)

    def _factor(self, clauses: Sequence[Clause], shown: dict[str, Floats]) -> Scores:
        """(n,) in [0, 1]: the product over the clauses, 1 without any."""
        out = np.ones(len(self._corpus.texts))
        for clause in clauses:
            probability = np.max([shown[thing] for thing in clause.things], axis=0)
            out *= self._weighed(clause, probability)
        return out.astype(np.float32)

    def _weighed(self, clause: Clause, probability: Floats) -> Floats:
        known = probability.max(initial=0.0) >= KNOWN
        if clause.how == "not" or not known:
            return 1 - probability if clause.how != "near" else np.ones_like(probability)
        nearness = np.exp(-self._metres(probability >= SHOWS * probability.max()) / self.reach)
        if clause.how == "far":
            return (1 - nearness) * (1 - probability)
        return FLOOR + (1 - FLOOR) * np.maximum(nearness, probability)

    def _metres(self, showing: Mask) -> Floats:
        """(n,) metres from each node to the nearest that shows a thing; 0 where it does itself."""
        metres, _ = cKDTree(self._at[showing]).query(self._at)
        return np.asarray(metres, np.float64)

    @cached_property
    def _at(self) -> Floats:
        topomap = self._corpus.topomap
        return cartesian(topomap.frame, topomap.positions)

    @cached_property
    def reach(self) -> float:
        """Metres at which nearness falls to 1/e: two spacings of the map's nodes, 5 to 50 m."""
        return float(np.clip(STEPS * spacing(self._corpus.topomap), LEAST_M, MOST_M))

    def _said(self, clause: Clause, shown: dict[str, Floats]) -> str:
        unknown = all(shown[thing].max(initial=0.0) < KNOWN for thing in clause.things)
        return f"{clause} (not known here)" if unknown else str(clause)


def spacing(topomap: TopoMap) -> float:
    """The median distance in metres from a node to the nearest at another place; 0 where all stand at one."""
    at = cartesian(topomap.frame, topomap.positions)
    if len(at) < 2:
        return 0.0
    metres, _ = cKDTree(at).query(at, k=min(len(at), 8))
    apart = np.where(metres > _APART_M, metres, np.inf).min(axis=1)
    known = apart[np.isfinite(apart)]
    return float(np.median(known)) if len(known) else 0.0
