"""Sentences of a scope that answer a question between them: near to it, and unlike each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erag.core.types import IntArray
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus, split_sentences

POOL = 60  # sentences nearest to the question, among which those to be told are chosen
NEARNESS = 0.7  # weight of being near to the question against being unlike what is told already


@dataclass(frozen=True, slots=True)
class View:
    """A sentence, and the row of the node that says it."""

    text: str
    row: int


class Views:
    """Chooses sentences by maximal marginal relevance (Carbonell and Goldstein 1998)."""

    def __init__(self, corpus: Corpus) -> None:
        self._corpus = corpus

    def of(self, vector: Vectors, rows: IntArray, limit: int) -> list[View]:
        """At most `limit` sentences of the nodes `rows` (r,) for a question with the vector (d,), best first."""
        here = np.flatnonzero(np.isin(self._corpus.sentence_rows, rows))
        near = self._corpus.sentence_vectors[here] @ vector
        pool = here[np.lexsort((here, -near))[:POOL]]
        vectors = self._corpus.sentence_vectors[pool]
        chosen = _marginal(vectors @ vector, vectors @ vectors.T, limit)
        return [View(self._sentences[pool[i]], int(self._corpus.sentence_rows[pool[i]])) for i in chosen]

    @cached_property
    def _sentences(self) -> tuple[str, ...]:
        return split_sentences(self._corpus.texts)[0]


def _marginal(near: Vectors, alike: Vectors, limit: int) -> list[int]:
    """Places of the chosen: `near` (p,) to the question, `alike` (p, p) to each other; no two say the same."""
    chosen: list[int] = []
    open_ = np.ones(len(near), np.bool_)
    repeated = np.zeros(len(near))
    while len(chosen) < limit and open_.any():
        worth = NEARNESS * near - (1 - NEARNESS) * repeated
        best = int(np.where(open_, worth, -np.inf).argmax())
        chosen.append(best)
        repeated = np.maximum(repeated, alike[best])
        open_ &= alike[best] < 0.999  # the sentence itself, and its copies elsewhere
    return chosen
