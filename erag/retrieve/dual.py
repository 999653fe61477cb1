"""LightRAG's two levels (Guo et al., 2024) over the semantic forest."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from erag.core.types import IntArray
from erag.lm.roles import Vectors
from erag.retrieve.collapsed import ordered
from erag.retrieve.config import DualConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.flat import SentenceScorer
from erag.retrieve.rows import ForestRows, distinct, placed, within_budget
from erag.retrieve.scoring import Batch, Mask, Reached, Scores, best_first


class Keys(Protocol):
    """The low-level (things, names) and high-level (themes) keywords of questions: theirs is a language model."""

    def vectors(self, batch: Batch) -> tuple[Vectors, Vectors]:
        """The embedded low-level and high-level keywords, (q, d) each, unit rows."""
        ...


class DualSearch:
    """Theirs: a model names the question's low-level and high-level keywords; the entities nearest to the former and
    the relations nearest to the latter are looked up (`top_k` each, cosine above `threshold`), the two lists are
    merged in turn, and the chunks they come from, those nearest to the question, fill a context.

    Ours: the specific index are the sentences of the base nodes, a node counting by its best one, instead of extracted
    entities; the thematic index are the clusters instead of relations, and a cluster leads to the `related` leaves
    below it that are nearest to the question. Without `keys` the question itself is both. The first of the merged list
    that fit the context are the answers, in its order.
    """

    def __init__(self, corpus: Corpus, config: DualConfig, keys: Keys | None = None) -> None:
        self._config, self._keys = config, keys
        self._rows, self._sentences = ForestRows(corpus, config.cluster_embedding), SentenceScorer(corpus)
        self._n, self._searchable = corpus.forest.n_leaves, corpus.searchable

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`. Every leaf and every cluster with something below is compared."""
        seen = int(self._rows.alive(self._searchable[None]).sum())
        return [placed(rows, seen) for rows in self.select(batch, eligible)]

    def select(self, batch: Batch, eligible: Mask) -> list[IntArray]:
        """The leaves that fill each query's context, in the order of the merged list."""
        low, high = (batch.vectors, batch.vectors) if self._keys is None else self._keys.vectors(batch)
        specific = self._sentences.scores(Batch(batch.texts, low))
        themes, own = self._rows.similarities(high)[:, self._n :], self._rows.similarities(batch.vectors)
        alive = self._rows.alive(eligible)[:, self._n :]
        return [self._merged(*one) for one in zip(specific, themes, own, eligible, alive, strict=True)]

    def _merged(self, specific: Scores, themes: Scores, own: Scores, eligible: Mask, alive: Mask) -> IntArray:
        local = self._nearest(specific, eligible)
        below = [ordered(self._rows.leaves(int(c) + self._n), own, eligible) for c in self._nearest(themes, alive)]
        thematic = distinct([leaves[: self._config.related] for leaves in below])
        merged = distinct([in_turn(local, thematic)])
        return within_budget(merged, self._rows.tokens, self._config.tokens)

    def _nearest(self, scores: Scores, usable: Mask) -> IntArray:
        """The `top_k` usable columns above the threshold, best first."""
        kept = np.flatnonzero(usable & (scores > self._config.threshold))
        return kept[best_first(scores[kept], kept)][: self._config.top_k]


def in_turn(first: IntArray, second: IntArray) -> IntArray:
    """One of the first, one of the second, and so on; what is left of the longer list follows."""
    places = np.concatenate([2 * np.arange(len(first)), 2 * np.arange(len(second)) + 1])
    return np.concatenate([first, second])[np.argsort(places)]
