"""An index of the words of all texts with their places: what a query's words, and words side by side, are found in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from erag.core.text import singular, word_set, words
from erag.core.types import IntArray

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
        self._row_at = np.repeat(np.arange(len(said)), self._lengths + NEAR)  # of each place
        self._mean = max(float(self._lengths.mean()), 1.0) if said else 1.0
        self._places = _postings(said, self._lengths)

    def rows(self, token: str) -> IntArray:
        """The texts that have a word, (r,) ascending."""
        return _distinct(self._row_at[self._at(token)])

    def phrase_rows(self, phrase: Sequence[str]) -> IntArray:
        """The texts in which the words of a phrase stand directly one after the other, (r,) ascending."""
        at = self._at(phrase[0]) if phrase else np.empty(0, np.int64)
        for distance, token in enumerate(phrase[1:], 1):
            at = at[_among(at + distance, self._at(token))]
        return _distinct(self._row_at[at])

    def shares(self, asked: Sequence[str]) -> Floats:
        """(n,) the share of distinct words that each text has, weighted by how rare they are on this map."""
        rarity = {token: self._rarity(token) for token in asked}
        total, out = max(sum(rarity.values()), 1e-9), np.zeros(self.count)
        for token, weight in rarity.items():
            out[self.rows(token)] += weight
        return out / total

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
            rows, often = np.unique(self._row_at[self._at(token)], return_counts=True)
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
            near |= _among(a + distance, b)
        return _distinct(self._row_at[a[near]])

    def _rarity(self, token: str) -> float:
        n, found = self.count, len(self.rows(token))
        return float(np.log1p((n - found + 0.5) / (found + 0.5)))

    def _at(self, token: str) -> IntArray:
        return self._places.get(token, _NOWHERE)


_NOWHERE = np.empty(0, np.int64)


def _postings(said: Sequence[Sequence[str]], lengths: IntArray) -> dict[str, IntArray]:
    """The places of each word, ascending; texts follow each other with a gap that no pair spans."""
    known: dict[str, int] = {}
    word = np.array([known.setdefault(token, len(known)) for text in said for token in text], np.int64)
    place = np.arange(len(word)) + np.repeat(np.arange(len(lengths)) * NEAR, lengths)
    order = np.argsort(word, kind="stable")
    ends = np.cumsum(np.bincount(word, minlength=len(known)))
    return dict(zip(known, np.split(place[order], ends[:-1]), strict=True)) if known else {}


def _among(keys: IntArray, places: IntArray) -> npt.NDArray[np.bool_]:
    """(k,) bool: which of ascending `keys` are among ascending `places`."""
    if not len(places):
        return np.zeros(len(keys), np.bool_)
    at = np.minimum(np.searchsorted(places, keys), len(places) - 1)
    return np.asarray(places[at] == keys)


def _distinct(rows: IntArray) -> IntArray:
    """Ascending rows without repetitions."""
    return rows[np.diff(rows, prepend=-1) > 0]
