"""Scores of leaves for queries with text: what every flat retriever offers, and cosines that no batch can change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray
from erag.lm.roles import Vectors

Scores = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
NOT_FOUND = np.float32(-1.0)  # a leaf that the retriever cannot reach at all, unlike one that scores 0
_ROWS = 2048  # rows of a table multiplied at once


@dataclass(frozen=True, slots=True)
class Factors:
    """How well nodes meet the conditions of q queries: `by` (q, n) in [0, 1]; `alone` (q,): nothing else is wanted."""

    by: Scores
    alone: Mask


@dataclass(frozen=True, slots=True)
class Batch:
    """Queries that have text: `texts` (q,) and their `vectors` (q, d), unit rows.

    What else is searched for each of them is `also`, a batch of q rows, or `named`, a batch of things for each query;
    an empty text or batch for a query where nothing is, neither where that holds for all. `factors`: of the conditions
    that the queries set; None where none sets any. `spatial` (q, n): how near nodes are to where each query is asked
    from, NaN where that is not said; None where no query says it.
    """

    texts: tuple[str, ...]
    vectors: Vectors
    also: Batch | None = None
    named: tuple[Batch, ...] = ()
    factors: Factors | None = None
    spatial: npt.NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.texts)


class LeafScorer(Protocol):
    """A flat retriever. It may be called with any batch; a query's scores do not depend on the others."""

    def scores(self, batch: Batch) -> Scores:
        """(q, n) float32 in [0, 1], or `NOT_FOUND`, for all n nodes."""
        ...


@dataclass(frozen=True, slots=True)
class Reached:
    """What a search found for one query: `rows` (r,) int64 ascending with `scores` (r,), and what it looked at.

    `best` is the highest score of all that may be found, where more was scored than was reached.
    """

    rows: IntArray
    scores: Scores
    visited: int
    best: float | None = None


class Search(Protocol):
    """A retriever with text: flat or tree."""

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """For each query the leaves found among those it may return, `eligible` (q, n)."""
        ...


class FlatSearch:
    """A full scan of `leaves` nodes that have a text."""

    def __init__(self, scorer: LeafScorer, leaves: int) -> None:
        self._scorer, self._leaves = scorer, leaves

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`."""
        scores = self._scorer.scores(batch)
        kept = eligible & (scores >= 0)
        return [Reached(np.flatnonzero(k), s[k], self._leaves) for s, k in zip(scores, kept, strict=True)]


def similarity(table: Vectors, vectors: Vectors) -> Scores:
    """Cosines (q, m) of unit rows (m, d) and (q, d).

    Sums are made in double precision: in single precision their last digits depend on where in a product a row
    stands, so that equal texts would not tie and a query would score differently alone and in a batch.
    """
    out = np.empty((len(vectors), len(table)), np.float32)
    wide = vectors.T.astype(np.float64)
    for start in range(0, len(table), _ROWS):
        part = slice(start, start + _ROWS)
        out[:, part] = (table[part].astype(np.float64) @ wide).T
    return out


def pair_similarity(table: Vectors, vectors: Vectors, queries: IntArray, rows: IntArray) -> Scores:
    """Cosines (p,) of `table[rows]` and `vectors[queries]`; equal to those of `similarity`."""
    out = np.empty(len(rows), np.float32)
    wide = vectors.astype(np.float64)
    for start in range(0, len(rows), _ROWS):
        part = slice(start, start + _ROWS)
        out[part] = np.einsum("pd,pd->p", wide[queries[part]], table[rows[part]].astype(np.float64))
    return out


def best_first(scores: npt.NDArray[Any], *ties: npt.NDArray[Any]) -> IntArray:
    """The order (r,) of descending scores; equal ones by ascending `ties`, the first of which counts most."""
    return np.lexsort((*reversed(ties), -scores)).astype(np.int64)
