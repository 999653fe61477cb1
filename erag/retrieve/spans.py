"""The leaves below each row of a forest as ranges of one order, so that maxima are pushed up in one step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erag.core.types import Forest, IntArray


@dataclass(frozen=True)
class LeafSpans:
    """`leaves` (n,) int64 in depth-first order; `start` and `end` (c,) int64: the range of each cluster in it."""

    leaves: IntArray
    start: IntArray
    end: IntArray

    def lowest(self, ranks: IntArray) -> IntArray:
        """The lowest rank below each of the m rows, (q, m), from the ranks (q, n) of the leaves, all within [0, n].

        A cluster without leaves gets n.
        """
        q, n = ranks.shape
        if not len(self.start):
            return ranks
        bounds = np.stack([self.start, self.end], axis=1).ravel()  # every second range is one of ours
        ordered = np.concatenate([ranks[:, self.leaves], np.full((q, 1), n, np.int64)], axis=1)
        below = np.minimum.reduceat(ordered, bounds, axis=1)[:, ::2]
        return np.concatenate([ranks, np.where(self.end > self.start, below, n)], axis=1)


def leaf_spans(forest: Forest) -> LeafSpans:
    """The spans of a forest, whatever levels its rows skip."""
    n, m = forest.n_leaves, len(forest.ids)
    leaves: list[int] = []
    spans = np.zeros((m, 2), np.int64)
    stack = [(int(row), 0) for row in forest.roots[::-1]]  # (row, 0 on the way down, 1 on the way up)
    while stack:
        row, way = stack.pop()
        spans[row, way] = len(leaves)
        if row < n:
            leaves.append(row)
        elif way == 0:
            stack.append((row, 1))
            stack.extend((int(below), 0) for below in forest.children[row][::-1])
    return LeafSpans(np.array(leaves, np.int64), spans[n:, 0], spans[n:, 1])
