"""The facts of a scope that a question asks for: counted by code, chosen by how near they are to its words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from erag.core.types import IntArray
from erag.forest.facts import Fact
from erag.forest.vocabulary import Entry, Vocabulary, map_vocabulary
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus

CANDIDATES = 400  # entries of a scope that are compared with a question, the most frequent
KINDS = frozenset({"place", "object", "attribute", "season"})
SHARE_POWER = 0.15  # how much being frequent counts beside being asked for


class Focus:
    """Facts of any set of nodes in the light of a question. Vectors of entries are computed once."""

    def __init__(self, corpus: Corpus, embed: Callable[[Sequence[str]], Vectors]) -> None:
        self._corpus, self._embed = corpus, embed
        self._vectors: dict[str, Vectors] = {}

    @cached_property
    def words(self) -> Vocabulary:
        """Everything the map mentions."""
        return map_vocabulary(self._corpus.topomap)

    def facts(self, vector: Vectors, rows: IntArray, limit: int, least_share: float) -> list[Fact]:
        """At most `limit` facts of the nodes `rows` (r,), those nearest to the question's vector (d,) first."""
        known = self._candidates(rows, least_share)
        if not known:
            return []
        near = self._of([fact.entry.shown for fact in known]) @ vector  # (k,)
        worth = np.maximum(near, 0) * np.array([fact.share for fact in known]) ** SHARE_POWER
        chosen: list[Fact] = []
        for i in np.lexsort((np.arange(len(known)), -worth)):
            if len(chosen) < limit and worth[i] > 0 and not any(_same(known[i].entry, f.entry) for f in chosen):
                chosen.append(known[i])
        return sorted(chosen, key=lambda f: (-f.views, f.entry.shown))

    def _candidates(self, rows: IntArray, least_share: float) -> list[Fact]:
        views = np.asarray(self.words.presence[rows].sum(axis=0), np.int64).ravel()
        least = max(1, least_share * len(rows), 2 if len(rows) > 20 else 1)
        met = [i for i in np.flatnonzero(views >= least) if self.words.entries[i].kind in KINDS]
        met.sort(key=lambda i: (-views[i], i))
        return [Fact(self.words.entries[i], int(views[i]), len(rows), 0.0) for i in met[:CANDIDATES]]

    def _of(self, shown: Sequence[str]) -> Vectors:
        new = [text for text in dict.fromkeys(shown) if text not in self._vectors]
        if new:
            self._vectors.update(zip(new, self._embed(new), strict=True))
        return np.stack([self._vectors[text] for text in shown])


def counts(facts: Sequence[Fact]) -> str:
    """Facts as numbers: `Trees in 12 of 40 views, hedges in 3.`"""
    if not facts:
        return ""
    first, *rest = facts
    start = f"{first.entry.shown[:1].upper()}{first.entry.shown[1:]} in {first.views:,} of {first.of:,} views"
    return ", ".join((start, *(f"{f.entry.shown} in {f.views:,}" for f in rest))) + "."


def _same(one: Entry, other: Entry) -> bool:
    """Whether one says what the other already says, or nearly."""
    mine, theirs = set(one.words), set(other.words)
    return mine <= theirs or theirs <= mine
