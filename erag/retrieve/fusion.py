"""Reciprocal rank fusion of several flat retrievers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erag.retrieve.scoring import NOT_FOUND, Batch, LeafScorer, Scores


class FusionScorer:
    """The sum over the parts of 1 / (k + rank), divided by its largest possible value (Cormack et al., 2009).

    A rank is 1 + how many nodes score strictly better, so equal scores have equal ranks. A node that a part did not
    find has no rank there and gets nothing from it; a node that no part found is not found.
    """

    def __init__(self, parts: Sequence[LeafScorer], k: float) -> None:
        self._parts, self._k = tuple(parts), k

    def scores(self, batch: Batch) -> Scores:
        """(q, n) in [0, 1]; 1 for a node that is first in every part."""
        total: np.ndarray | float = 0.0
        for part in self._parts:
            total = total + self._reciprocal(part.scores(batch))
        fused = np.asarray(total) * (self._k + 1) / len(self._parts)
        return np.where(fused > 0, fused, NOT_FOUND).astype(np.float32)

    def _reciprocal(self, scores: Scores) -> np.ndarray:
        """1 / (k + rank), (q, n) float64; 0 where not found."""
        out = np.zeros(scores.shape)
        for row, found in zip(out, scores, strict=True):
            order = np.argsort(found)
            ascending = found[order]
            upto = np.searchsorted(ascending, ascending, side="right")  # sorted keys are found much faster
            row[order] = np.where(ascending >= 0, 1.0 / (self._k + 1 + (found.size - upto)), 0.0)
        return out
