"""The merges of a clustering in the order of their heights, and how they are cut and split."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Dendrogram:
    """k merges of n leaves, heights never falling; merge i makes node n + i of the two nodes `children[i]`.

    `children` (k, 2) int64, `height` (k,) float64 = the largest dissimilarity inside. k < n - 1 where the rest was not
    needed or lies above the cut.
    """

    n: int
    children: IntArray
    height: Doubles

    def __len__(self) -> int:
        return len(self.height)

    def tops(self, merges: int) -> list[int]:
        """The nodes left without a parent after the first `merges` merges, ascending."""
        free = np.ones(self.n + merges, bool)
        free[self.children[:merges].ravel()] = False
        return [int(i) for i in np.flatnonzero(free)]

    def sizes(self) -> IntArray:
        """(n + k,) number of leaves below each node."""
        size = np.ones(self.n + len(self), np.int64)
        for i, (a, b) in enumerate(self.children):
            size[self.n + i] = size[a] + size[b]
        return size

    def leaves(self, node: int) -> IntArray:
        """The leaves below `node`, ascending."""
        found, todo = [], [node]
        while todo:
            at = todo.pop()
            if at < self.n:
                found.append(at)
            else:
                todo.extend(int(c) for c in self.children[at - self.n])
        return np.sort(np.array(found, np.int64))

    def groups(self, merges: int, largest: int) -> list[IntArray]:
        """The clusters after the first `merges` merges, those above `largest` leaves split along their own subtree.

        Every leaf is in exactly one group; groups are ordered by their smallest leaf.
        """
        size, kept, todo = self.sizes(), [], self.tops(merges)
        while todo:
            node = todo.pop()
            if size[node] > largest:
                todo.extend(int(c) for c in self.children[node - self.n])
            else:
                kept.append(self.leaves(node))
        return sorted(kept, key=lambda g: int(g[0]))

    def labels(self, merges: int) -> IntArray:
        """(n,) number of the cluster of each leaf after the first `merges` merges, numbered by smallest leaf."""
        out = np.empty(self.n, np.int64)
        for number, group in enumerate(self.groups(merges, self.n)):
            out[group] = number
        return out


def from_merges(n: int, pairs: Sequence[tuple[int, int]], heights: Sequence[float]) -> Dendrogram:
    """A dendrogram from merges in order, each given by any leaf of either side."""
    parent = list(range(n))  # union-find over leaves
    node = list(range(n))  # root leaf -> dendrogram node
    children = np.empty((len(pairs), 2), np.int64)
    for i, (u, v) in enumerate(pairs):
        a, b = _find(parent, u), _find(parent, v)
        children[i] = sorted((node[a], node[b]))
        parent[b] = a
        node[a] = n + i
    return Dendrogram(n, children, np.asarray(heights, np.float64))


def _find(parent: list[int], at: int) -> int:
    while parent[at] != at:
        parent[at] = parent[parent[at]]
        at = parent[at]
    return at
