"""Whether a memory holds anything that answers a query, or has to say that it does not."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from erag.core.text import word_set
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus
from erag.retrieve.lexical import tokens
from erag.retrieve.named import borne

WORDS_WEIGHT = 0.3
# What a request says besides what it is about.
_ASKING = word_set("""
    find where take show me nearest closest place somewhere anywhere want would like look looking go get need have can
    could should may please there here bring guide way see
""")


class Sufficiency:
    """The evidence for a query: the best cosine of a text or sentence, and the share of its words found together.

    evidence = max cosine + 0.3 × (the largest share of the query's content words, weighted by how rare they are on this
    map, that one node has). Weak evidence does not prove absence; it says that nothing seen comes near.
    """

    def __init__(self, corpus: Corpus) -> None:
        self._corpus = corpus

    def evidence(self, text: str, vector: Vectors, eligible: npt.NDArray[np.bool_]) -> float:
        """The evidence, in [0, 1.3], that the nodes `eligible` (n,) hold for a query with the vector (d,)."""
        rows = np.flatnonzero(eligible & self._corpus.searchable)
        if not len(rows):
            return 0.0
        nodes = float((self._corpus.node_vectors[rows] @ vector).max())
        here = eligible[self._corpus.sentence_rows]
        spoken = float((self._corpus.sentence_vectors[here] @ vector).max()) if here.any() else 0.0
        return max(nodes, spoken, 0.0) + WORDS_WEIGHT * self._covered(text, rows)

    def mentioned(self, text: str, eligible: npt.NDArray[np.bool_]) -> bool:
        """Whether a request names a thing, and one of the nodes `eligible` (n,) mentions it by that very name."""
        return borne(self._corpus.index, text, eligible)

    def _covered(self, text: str, rows: npt.NDArray[np.int64]) -> float:
        asked = sorted({token for token in tokens(text) if token not in self._unasked})
        return float(self._corpus.index.shares(asked)[rows].max()) if asked else 0.0

    @cached_property
    def _unasked(self) -> frozenset[str]:
        from bm25s.stopwords import STOPWORDS_EN_PLUS

        return frozenset(STOPWORDS_EN_PLUS) | _ASKING
