"""All pairs of clusters whose members all lie within a dissimilarity, found in blocks of bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erag.core.errors import ConfigError
from erag.core.geometry import Points, cartesian
from erag.core.types import IntArray
from erag.forest.affinity import Affinity, Doubles

BLOCK = 512  # rows of a block: large enough for BLAS, small enough for the cache
TESTS = (1, 2, 4, 8, 16, 32)  # pairs of members tested at a time, before a pair of clusters is computed as a block
TESTED_AT_ONCE = 1 << 18  # pairs of clusters
SLACK = 1e-9  # bounds are rounded; a pair is decided by its exact value only
Step = Callable[[int, int], None]


class Pairs(NamedTuple):
    """Pairs `a`, `b` (p,) and their dissimilarity `d` (p,)."""

    a: IntArray
    b: IntArray
    d: Doubles

    def at(self, where: npt.NDArray[np.bool_] | slice) -> Pairs:
        return Pairs(self.a[where], self.b[where], self.d[where])


def _joined(parts: list[Pairs]) -> Pairs:
    a, b, d = ([part[i] for part in parts] for i in range(3))
    return Pairs(np.concatenate(a), np.concatenate(b), np.concatenate(d))


@dataclass
class Edges:
    """Pairs collected so far: clusters a < b and their dissimilarity, at most `limit` of them, all `<= height`.

    Where more come, the largest are let go and `height` falls to the largest that is kept.
    """

    height: float
    limit: int
    seen: int = 0
    _held: int = 0
    _a: list[npt.NDArray[np.int32]] = field(default_factory=list)
    _b: list[npt.NDArray[np.int32]] = field(default_factory=list)
    _d: list[Doubles] = field(default_factory=list)

    def add(self, pairs: Pairs) -> None:
        """Take in pairs. Raises ConfigError when more pairs tie for the smallest value than the limit holds."""
        if not len(pairs.d):
            return
        self._a.append(np.minimum(pairs.a, pairs.b).astype(np.int32))
        self._b.append(np.maximum(pairs.a, pairs.b).astype(np.int32))
        self._d.append(pairs.d)
        self.seen += len(pairs.d)
        self._held += len(pairs.d)
        if self._held > self.limit:
            self._shed()

    def _shed(self) -> None:
        a, b, d = self.arrays()
        kept = self.limit * 3 // 4
        keep = d < np.partition(d, kept)[kept]
        if not keep.any():
            raise ConfigError(
                f"more than {kept:,} pairs of rows have the same smallest dissimilarity {d.min():.6g}",
                where="forest.edge_limit", allowed="a limit that holds all of them", repair="--set forest.edge_limit=…",
            )  # fmt: skip
        self.height = float(d[keep].max())
        self._a, self._b, self._d = [a[keep]], [b[keep]], [d[keep]]
        self._held = int(keep.sum())

    def arrays(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Doubles]:
        """a, b (e,) int32 and d (e,) float64."""
        if not self._d:
            return np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0)
        if len(self._d) > 1:
            self._a, self._b = [np.concatenate(self._a)], [np.concatenate(self._b)]
            self._d = [np.concatenate(self._d)]
        return self._a[0], self._b[0], self._d[0]


@dataclass(frozen=True)
class Table:
    """Clusters to be paired: each stands for itself by one member, in an order that keeps near ones together.

    `rows` (n,) the affinity, rows of a cluster together; `start`, `size` (m,) where the rows of each cluster are;
    `order` (m,) clusters by the leaves of a k-d tree; `heads` the affinity of the first row of each cluster in that
    order and `points` (m, 3) their cartesian coordinates in metres; `low`, `high` (b, 3) the boxes of blocks of heads.
    """

    rows: Affinity
    start: IntArray
    size: IntArray
    order: IntArray
    heads: Affinity
    points: Points
    low: Doubles
    high: Doubles

    def __len__(self) -> int:
        return len(self.size)

    @property
    def blocks(self) -> int:
        return len(self.low)

    def block(self, i: int) -> slice:
        return slice(i * BLOCK, min(len(self), (i + 1) * BLOCK))

    def least_metres(self, i: int) -> Doubles:
        """(blocks - i,) a lower bound of the distance between a head of block i and one of each block from i on."""
        gap = np.maximum(0.0, np.maximum(self.low[i:] - self.high[i], self.low[i] - self.high[i:]))
        return np.asarray(np.linalg.norm(gap, axis=1))


def table(rows: Affinity, label: IntArray) -> Table:
    """Lay out `rows` of clusters `label` (n,), numbered from 0 without gaps."""
    from scipy.spatial import cKDTree

    by_cluster = np.argsort(label, kind="stable")
    size = np.bincount(label)
    start = np.cumsum(size) - size
    first = by_cluster[start]
    points = cartesian(rows.frame, rows.positions[first])
    order = cKDTree(points, leafsize=BLOCK // 8).indices
    points, at = points[order], np.arange(0, len(size), BLOCK)
    low, high = np.minimum.reduceat(points, at), np.maximum.reduceat(points, at)
    return Table(rows.take(by_cluster), start, size, order, rows.take(first[order]), points, low, high)


def pairs_within(clusters: Table, height: float, limit: int, step: Step | None = None) -> Edges:
    """All pairs of clusters with every pair of members `<= height`, or as many of the smallest as `limit` holds."""
    edges = Edges(height, limit)
    for i in range(clusters.blocks):
        heads = _heads_within(clusters, i, edges.height)
        for at in range(0, len(heads.d), TESTED_AT_ONCE):
            edges.add(_whole(clusters, heads.at(slice(at, at + TESTED_AT_ONCE)), edges.height))
        if step is not None:
            step(i + 1, clusters.blocks)
    return edges


def _heads_within(clusters: Table, i: int, height: float) -> Pairs:
    """Pairs of clusters whose heads, in block i and in all blocks from i on, are within `height`."""
    alpha, theta = clusters.rows.alpha, clusters.rows.theta
    apart = 1.0 - np.exp(-clusters.least_metres(i) / theta)  # (blocks - i,) the least spatial dissimilarity
    near = np.flatnonzero((1.0 - alpha) * apart <= height + SLACK)
    block = clusters.block(i)
    found = _joined([_close(clusters, block, clusters.block(i + int(j)), height, float(apart[j])) for j in near])
    return Pairs(clusters.order[found.a], clusters.order[found.b], found.d)


def _close(clusters: Table, a: slice, b: slice, height: float, apart: float) -> Pairs:
    """Pairs of heads of two blocks within `height`; `apart` bounds their spatial part from below."""
    rows = clusters.heads
    semantic = rows.semantic(a, b)
    room = height + SLACK - (1.0 - rows.alpha) * apart
    mask = rows.alpha * semantic <= room
    mask[~rows.texted[a], :] = mask[:, ~rows.texted[b]] = apart <= height + SLACK  # no text: the distance alone counts
    if a == b:
        mask = np.triu(mask, 1)
    at = np.flatnonzero(mask)
    i, j, s = at // mask.shape[1] + a.start, at % mask.shape[1] + b.start, semantic.ravel()[at]
    likely = rows.combine(_chord(clusters.points, i, j), s, rows.texted[i] & rows.texted[j]) <= height + SLACK
    i, j = i[likely], j[likely]
    pairs = Pairs(i, j, rows.of_pairs(i, j, s[likely]))
    return pairs.at(pairs.d <= height)


def _chord(points: Points, i: IntArray, j: IntArray) -> Doubles:
    """(p,) straight distances in metres, never above the distance in the map's frame and much cheaper."""
    gap = points[i] - points[j]
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", gap, gap)))


def _whole(clusters: Table, heads: Pairs, height: float) -> Pairs:
    """Of pairs of clusters whose heads are at d, those all of whose members are within `height`, at the largest.

    A few pairs of members are tested first, since most pairs of clusters fail at once.
    """
    left, done, tested = heads, [], 1
    for more in (*TESTS, 0):
        total = clusters.size[left.a] * clusters.size[left.b]
        done.append(left.at(total <= tested))
        left, total = left.at(total > tested), total[total > tested]
        if more and len(total):
            k = (tested + np.arange(more)) % total[:, None]  # (p, more); a repeated test does no harm
            left = left._replace(d=np.maximum(left.d, _members(clusters, left, k).max(axis=1)))
            left = left.at(left.d <= height)
            tested += more
    return _joined([*done, _by_blocks(clusters, left, height)])


def _members(clusters: Table, pairs: Pairs, k: IntArray) -> Doubles:
    """(p, t) dissimilarities of the k-th pairs (p, t) of members, 0 <= k < |a||b|, all different.

    Consecutive k step through both clusters at once.
    """
    size_a, size_b = clusters.size[pairs.a][:, None], clusters.size[pairs.b][:, None]
    i = k % size_a
    j = (k // size_a + i) % size_b
    rows_a, rows_b = clusters.start[pairs.a][:, None] + i, clusters.start[pairs.b][:, None] + j
    return clusters.rows.of_pairs(rows_a.ravel(), rows_b.ravel()).reshape(k.shape)


def _by_blocks(clusters: Table, pairs: Pairs, height: float) -> Pairs:
    """Large pairs of clusters, each through the block of all its members."""
    end = clusters.start + clusters.size
    worst = np.empty(len(pairs.d))
    for at, (a, b) in enumerate(zip(pairs.a, pairs.b, strict=True)):
        rows_a, rows_b = slice(clusters.start[a], end[a]), slice(clusters.start[b], end[b])
        worst[at] = clusters.rows.block(rows_a, rows_b).max()
    return pairs._replace(d=worst).at(worst <= height)
