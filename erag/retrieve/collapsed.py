"""RAPTOR's collapsed tree (Sarthi et al., 2024) over the semantic forest."""

from __future__ import annotations

import numpy as np

from erag.core.types import IntArray
from erag.retrieve.config import CollapsedConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.rows import ForestRows, distinct, placed, within_budget
from erag.retrieve.scoring import Batch, Mask, Reached, Scores, best_first


class CollapsedSearch:
    """Theirs: all layers in one list, sorted by cosine to the query; rows fill a context until the next would not fit.

    Ours: their context goes to a language model, a robot has to go somewhere. So a selected leaf is an answer, and a
    selected cluster stands for the leaves below it, the most similar first; the first row that brings a leaf gives it
    its place. Rows with nothing below that may be returned are passed by and cost nothing.
    """

    def __init__(self, corpus: Corpus, config: CollapsedConfig) -> None:
        self._config, self._rows = config, ForestRows(corpus, config.cluster_embedding)
        self._searchable = corpus.searchable

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`. Every row with something below is scored."""
        similar, alive = self._rows.similarities(batch.vectors), self._rows.alive(eligible)
        seen = int(self._rows.alive(self._searchable[None]).sum())
        return [
            placed(self._leaves(s, self._select(s, a), e), seen) for s, a, e in self._each(similar, alive, eligible)
        ]

    def select(self, batch: Batch, eligible: Mask) -> list[IntArray]:
        """The rows of the forest that fill each query's context, best first, for a model that reads their texts."""
        similar, alive = self._rows.similarities(batch.vectors), self._rows.alive(eligible)
        return [self._select(s, a) for s, a, _ in self._each(similar, alive, eligible)]

    def _select(self, similar: Scores, alive: Mask) -> IntArray:
        rows = np.flatnonzero(alive)
        order = rows[best_first(similar[rows], rows)]
        return within_budget(order, self._rows.tokens, self._config.tokens)

    def _leaves(self, similar: Scores, selected: IntArray, eligible: Mask) -> IntArray:
        return distinct([ordered(self._rows.leaves(int(row)), similar, eligible) for row in selected])

    @staticmethod
    def _each(similar: Scores, alive: Mask, eligible: Mask) -> zip[tuple[Scores, Mask, Mask]]:
        return zip(similar, alive, eligible, strict=True)


def ordered(leaves: IntArray, similar: Scores, eligible: Mask) -> IntArray:
    """The eligible (n,) of `leaves`, the most similar (m,) first."""
    kept = leaves[eligible[leaves]]
    return kept[best_first(similar[kept], kept)]
