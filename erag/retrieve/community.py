"""GraphRAG's global search (Edge et al., 2024) over the semantic forest."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from erag.core.types import NO_PARENT, Forest, IntArray
from erag.retrieve.collapsed import ordered
from erag.retrieve.config import CommunityConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.rows import ForestRows, distinct, placed, within_budget
from erag.retrieve.scoring import Batch, Mask, Reached, Scores, best_first

HELPFUL = 100  # helpfulness is an integer from 0, not at all, to this


class Rater(Protocol):
    """How helpful a community's report is for a question: theirs is a language model that reads it."""

    def rate(self, batch: Batch, reports: IntArray) -> IntArray:
        """(q, r) integers from 0 to 100 for the forest's rows `reports` (r,); independent of the other queries."""
        ...


class CommunitySearch:
    """Theirs: the reports of the communities of one level are rated from 0 to 100 by a language model, those rated 0
    are dropped, the rest fill a context from the most helpful on until the next would not fit, and an answer is
    written from them.

    Ours: communities are the clusters at `level` instead of those of an extracted entity graph (for each leaf the
    lowest row above it at that level or higher, else the root above it); each report is rated alone, without a `rater`
    by its cosine; the leaves below the communities kept are the answers, community by community in the order of
    helpfulness, and the most similar first within one.
    """

    def __init__(self, corpus: Corpus, config: CommunityConfig, rater: Rater | None = None) -> None:
        self._config, self._rater = config, rater
        self._rows = ForestRows(corpus, config.cluster_embedding)
        self.reports = communities(corpus.forest, config.level)
        self._leaves = int(corpus.searchable.sum())

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`. Every report is rated and every leaf compared."""
        similar = self._rows.similarities(batch.vectors)
        made, seen = [], self._leaves + int((self.reports >= eligible.shape[1]).sum())
        for selected, s, e in zip(self._selected(batch, similar, eligible), similar, eligible, strict=True):
            made.append(placed(distinct([ordered(self._rows.leaves(int(row)), s, e) for row in selected]), seen))
        return made

    def select(self, batch: Batch, eligible: Mask) -> list[IntArray]:
        """The reports that fill each query's context, the most helpful first, for a model that reads them."""
        return self._selected(batch, self._rows.similarities(batch.vectors), eligible)

    def _selected(self, batch: Batch, similar: Scores, eligible: Mask) -> list[IntArray]:
        rated = similar[:, self.reports] if self._rater is None else self._rate(batch, self._rater)
        alive, made = self._rows.alive(eligible)[:, self.reports], []
        for helpful, usable, s in zip(rated, alive, similar, strict=True):
            kept = np.flatnonzero(usable & (np.rint(helpful * HELPFUL) > 0))
            order = self.reports[kept[best_first(helpful[kept], -s[self.reports[kept]], self.reports[kept])]]
            made.append(within_budget(order, self._rows.tokens, self._config.tokens))
        return made

    def _rate(self, batch: Batch, rater: Rater) -> npt.NDArray[np.float64]:
        found = np.asarray(rater.rate(batch, self.reports))
        expected = (len(batch), len(self.reports))
        if found.shape != expected or ((found < 0) | (found > HELPFUL)).any():
            raise ValueError(f"ratings of shape {found.shape}, expected {expected} integers from 0 to {HELPFUL}")
        return found / HELPFUL


def communities(forest: Forest, level: int) -> IntArray:
    """The rows (r,), ascending, that together stand for every leaf once, none of them below `level` but roots."""
    found = set[int]()
    for row in range(forest.n_leaves):
        while forest.level[row] < level and forest.parent[row] != NO_PARENT:
            row = int(forest.parent[row])
        found.add(row)
    return np.array(sorted(found), np.int64)
