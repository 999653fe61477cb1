"""What the rules of other systems need of a forest's rows: vectors, tokens, the leaves below, an order as scores."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from erag.core.types import IntArray
from erag.forest.evidence import tokens
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus
from erag.retrieve.scoring import Mask, Reached, Scores, similarity
from erag.retrieve.spans import leaf_spans

UNWRITTEN = 131  # tokens a summary is taken to have where none was written: the mean of RAPTOR's (its appendix)
_K = 60.0  # as reciprocal rank fusion: what comes first scores 1, the 61st half as much


def cluster_vectors(corpus: Corpus, embedding: Literal["summary", "mean"]) -> Vectors:
    """(c, d): the vectors clusters are compared by; the mean of a cluster's nodes where it has no summary."""
    means = corpus.forest.embeddings[corpus.forest.n_leaves :]
    if embedding == "mean":
        return means
    spoken = corpus.summary_vectors.any(axis=1, keepdims=True)
    return np.where(spoken, corpus.summary_vectors, means)


class ForestRows:
    """The m rows of a corpus' forest, leaves first: how near they come to a query, what they cost, what lies below."""

    def __init__(self, corpus: Corpus, embedding: Literal["summary", "mean"]) -> None:
        self._corpus, self._forest = corpus, corpus.forest
        self._vectors = (corpus.node_vectors, cluster_vectors(corpus, embedding))
        self._spans = leaf_spans(corpus.forest)

    @cached_property
    def tokens(self) -> IntArray:
        """(m,) estimated tokens of each row's text: a node's text, a cluster's summary or name."""
        written = [cluster.summary or cluster.name for cluster in self._forest.clusters]
        costs = [tokens(t) for t in self._corpus.texts] + [tokens(t) if t else UNWRITTEN for t in written]
        return np.array(costs, np.int64)

    def similarities(self, vectors: Vectors) -> Scores:
        """(q, m) cosines to query vectors (q, d), negative ones 0."""
        both = [similarity(table, vectors) for table in self._vectors]
        return np.clip(np.concatenate(both, axis=1), 0.0, 1.0)

    def alive(self, eligible: Mask) -> Mask:
        """(q, m): rows with an eligible leaf below, from (q, n)."""
        n = self._forest.n_leaves
        return np.asarray(self._spans.lowest(np.where(eligible, np.arange(n), n)) < n)

    def leaves(self, row: int) -> IntArray:
        """The leaves below a row, itself where it is one."""
        n = self._forest.n_leaves
        if row < n:
            return np.array([row], np.int64)
        return self._spans.leaves[self._spans.start[row - n] : self._spans.end[row - n]]


def within_budget(order: IntArray, costs: IntArray, budget: int) -> IntArray:
    """The rows (r,) of `order` before the first that would exceed `budget`; `costs` (m,) by row."""
    return order[np.cumsum(costs[order]) <= budget]


def distinct(rows: Sequence[IntArray]) -> IntArray:
    """The rows of several lists one after the other, each at its first place."""
    joined = np.concatenate([np.empty(0, np.int64), *rows])
    _, first = np.unique(joined, return_index=True)
    return joined[np.sort(first)]


def placed(order: IntArray, visited: int) -> Reached:
    """What was found, best first, as `Reached`: the score of the p-th place is 61 / (60 + p)."""
    scores = ((_K + 1) / (_K + 1 + np.arange(len(order)))).astype(np.float32)
    ascending = np.argsort(order)
    return Reached(order[ascending], scores[ascending], visited)
