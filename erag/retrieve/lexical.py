"""An index of the words of all texts with their places: what a query's words, and words side by side, are found in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from erag.core.text import word_set, words
from erag.core.types import IntArray
from erag.retrieve.bm25 import singular

Floats = npt.NDArray[np.float64]
K1, B = 1.5, 0.75  # of BM25
NEAR = 2  # words that stand at most so far apart, in their order, stand side by side
# What a request says besides what it is about.
_ASKING = word_set("""
    find where take show me nearest closest place somewhere anywhere want would like look looking go get need have can
    could should may please there here bring guide way see spot robot around close nearby thing something
""")


def tokens(text: str) -> list[str]:
    """The words of a text as they are compared: lower case, singular."""
    return [singular(word) for word in words(text)]


def content(text: str) -> list[str]:
    """The words of a request that say what it is about, in their order."""
    return [token for token in tokens(text) if token not in _unasked()]


@lru_cache(maxsize=1)
def _unasked() -> frozenset[str]:
    from bm25s.stopwords import STOPWORDS_EN_PLUS

    return frozenset(STOPWORDS_EN_PLUS) | _ASKING


class LexicalIndex:
    """Where each word stands in n texts."""

    def __init__(self, texts: Sequence[str]) -> None:
        said = [tokens(text) for text in texts]
        self.count = len(said)
        self._lengths = np.array([len(t) for t in said], np.int64)
        starts = np.concatenate([[0], np.cumsum(self._lengths + NEAR)])[:-1] if said else np.empty(0, np.int64)
        self._starts = starts.astype(np.int64)
        self._mean = max(float(self._lengths.mean()), 1.0) if said else 1.0
        self._places = _postings(said, self._starts)

    def rows(self, token: str) -> IntArray:
        """The texts that have a word, (r,) ascending."""
        return np.unique(self._row_of(self._at(token)))

    def phrase_rows(self, phrase: Sequence[str]) -> IntArray:
        """The texts in which the words of a phrase stand directly one after the other, (r,) ascending."""
        at = self._at(phrase[0]) if phrase else np.empty(0, np.int64)
        for distance, token in enumerate(phrase[1:], 1):
            at = at[np.isin(at + distance, self._at(token), assume_unique=True)]
        return np.unique(self._row_of(at))

    def matches(self, text: str) -> Floats:
        """(n, 3): BM25 and the weighted share of the words of a request that a text has, and of its neighbouring pairs.

        BM25 is divided by the most that the request could score, so that it means the same on every map; shares are
        weighted by how rare the words are. Zeros for a request without content.
        """
        out = np.zeros((self.count, 3))
        asked = content(text)
        distinct = list(dict.fromkeys(asked))
        rarity = np.array([self._rarity(token) for token in distinct])
        if not distinct or rarity.sum() <= 0:
            return out
        for token, weight in zip(distinct, rarity / rarity.sum(), strict=True):
            rows, often = np.unique(self._row_of(self._at(token)), return_counts=True)
            length = 1 - B + B * self._lengths[rows] / self._mean
            out[rows, 0] += weight * often / (often + K1 * length)
            out[rows, 1] += weight
        pairs = list(pairwise(asked))
        if not pairs:
            out[:, 2] = out[:, 1]
        for first, second in pairs:
            out[self._side_by_side(first, second), 2] += 1 / len(pairs)
        return out

    def _side_by_side(self, first: str, second: str) -> IntArray:
        a, b = self._at(first), self._at(second)
        near = np.zeros(len(a), np.bool_)
        for distance in range(1, NEAR + 1):
            near |= np.isin(a + distance, b, assume_unique=True)
        return np.unique(self._row_of(a[near]))

    def _rarity(self, token: str) -> float:
        n, found = self.count, len(self.rows(token))
        return float(np.log1p((n - found + 0.5) / (found + 0.5)))

    def _at(self, token: str) -> IntArray:
        return self._places.get(token, _NOWHERE)

    def _row_of(self, at: IntArray) -> IntArray:
        return np.searchsorted(self._starts, at, side="right") - 1


_NOWHERE = np.empty(0, np.int64)


def _postings(said: Iterable[Sequence[str]], starts: IntArray) -> dict[str, IntArray]:
    """The places of each word, ascending; texts follow each other with a gap that no pair spans."""
    found: dict[str, list[int]] = {}
    for start, text in zip(starts.tolist(), said, strict=True):
        for place, token in enumerate(text, start):
            found.setdefault(token, []).append(place)
    return {token: np.array(places, np.int64) for token, places in found.items()}
