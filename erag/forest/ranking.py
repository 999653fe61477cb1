"""A strict order of pairs by dissimilarity, so that complete linkage has one answer also where pairs tie."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray

Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
PairOf = Callable[[IntArray], tuple[npt.NDArray[np.integer], npt.NDArray[np.integer]]]


def ranked(d: Doubles, pair_of: PairOf) -> tuple[Ints, Doubles]:
    """Ranks (p,) int32 of p < 2^31 pairs by dissimilarity d (p,), and d in ascending order.

    Pairs that tie are ordered by a fixed hash of their rows (i, j), which `pair_of` gives for some of the p indices. An
    order by index would make chains of merges that add one row at a time, which cannot be split into even parts; a hash
    makes balanced ones.
    """
    order = np.argsort(d)
    ascending = d[order]
    tied = np.zeros(len(d), bool)
    tied[1:] = ascending[1:] == ascending[:-1]
    if tied.any():
        run = np.cumsum(~tied)  # number of the run of equal values
        tied[:-1] |= tied[1:]
        at = np.flatnonzero(tied)
        order[at] = order[at][np.lexsort((_mixed(*pair_of(order[at])), run[at]))]
    rank = np.empty(len(d), np.int32)
    rank[order] = np.arange(len(d), dtype=np.int32)
    return rank, ascending


def _mixed(i: npt.NDArray[np.integer], j: npt.NDArray[np.integer]) -> npt.NDArray[np.uint64]:
    """A 64-bit hash of each pair, different for different pairs of rows below 2^32 (splitmix64's bijection)."""
    x = (i.astype(np.uint64) << np.uint64(32)) | j.astype(np.uint64)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ (x >> np.uint64(31)))


def condensed_pairs(n: int) -> PairOf:
    """For indices into a condensed matrix of n rows, in scipy's order, the rows i < j."""
    i = np.arange(n)
    starts = i * (2 * n - i - 1) // 2  # index of the pair (i, i + 1)

    def pair_of(index: IntArray) -> tuple[IntArray, IntArray]:
        row = np.searchsorted(starts[:-1], index, side="right") - 1
        return row, index - starts[row] + row + 1

    return pair_of
