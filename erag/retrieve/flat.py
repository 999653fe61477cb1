"""Flat retrievers by vectors, one a node or one a sentence: both can score a few leaves alone.

A negative cosine scores 0.
"""

from __future__ import annotations

import numpy as np

from erag.core.types import IntArray
from erag.retrieve.corpus import Corpus
from erag.retrieve.scoring import NOT_FOUND, Batch, Scores, pair_similarity, similarity


class NodeScorer:
    """The cosine of the query and a node's whole text."""

    def __init__(self, corpus: Corpus) -> None:
        self._vectors, self._searchable = corpus.node_vectors, corpus.searchable

    def scores(self, batch: Batch) -> Scores:
        """(q, n); `NOT_FOUND` for nodes without text."""
        found = np.clip(similarity(self._vectors, batch.vectors), 0, 1)
        return np.where(self._searchable, found, NOT_FOUND)

    def pair_scores(self, batch: Batch, queries: IntArray, rows: IntArray) -> Scores:
        """(p,) scores of nodes `rows` (p,) for the queries `queries` (p,) of the batch."""
        found = np.clip(pair_similarity(self._vectors, batch.vectors, queries, rows), 0, 1)
        return np.where(self._searchable[rows], found, NOT_FOUND)


class SentenceScorer:
    """The cosine of the query and the sentence of a node that fits it best."""

    def __init__(self, corpus: Corpus) -> None:
        self._vectors = corpus.sentence_vectors
        nodes = np.arange(len(corpus.texts))
        self._first = np.searchsorted(corpus.sentence_rows, nodes)  # (n,) first sentence of each node
        self._count = np.searchsorted(corpus.sentence_rows, nodes, side="right") - self._first
        self._found = corpus.searchable & (self._count > 0)

    def scores(self, batch: Batch) -> Scores:
        """(q, n); `NOT_FOUND` for nodes without sentences."""
        out = np.full((len(batch), len(self._count)), NOT_FOUND, np.float32)
        spoken = np.flatnonzero(self._count)
        if len(spoken):
            by_sentence = similarity(self._vectors, batch.vectors)  # (q, s)
            out[:, spoken] = np.clip(np.maximum.reduceat(by_sentence, self._first[spoken], axis=1), 0, 1)
        return np.where(self._found, out, NOT_FOUND)

    def pair_scores(self, batch: Batch, queries: IntArray, rows: IntArray) -> Scores:
        """(p,) scores of nodes `rows` (p,) for the queries `queries` (p,) of the batch."""
        out = np.full(len(rows), NOT_FOUND, np.float32)
        spoken = np.flatnonzero(self._found[rows])
        if len(spoken):
            counts = self._count[rows[spoken]]
            starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
            sentences = np.repeat(self._first[rows[spoken]] - starts, counts) + np.arange(counts.sum())
            found = pair_similarity(self._vectors, batch.vectors, np.repeat(queries[spoken], counts), sentences)
            out[spoken] = np.clip(np.maximum.reduceat(found, starts), 0, 1)
        return out
