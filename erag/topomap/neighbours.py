"""Nearest nodes and nodes within a radius: k-d trees for speed, the frame's own distance for the answer."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from erag.core.errors import ConfigError
from erag.core.geometry import Points, cartesian, distance
from erag.core.types import Frame, IntArray

MAX_RADIUS_EDGES = 10_000_000
RADIUS_PERCENTILE, RADIUS_FACTOR = 95.0, 1.5
_SLACK_M = 1e-6  # far above the rounding of Earth-centred coordinates, far below any map's precision


class Found(NamedTuple):
    """For each of q queries the `row` (q,) int64 of the nearest point and its `metres` (q,); -1 and inf for none."""

    row: IntArray
    metres: npt.NDArray[np.float64]


class Neighbours:
    """The points (n, 3) of a map, searchable by exact distance; the tree is built on first use."""

    def __init__(self, frame: Frame, positions: Points) -> None:
        self.frame, self.positions = frame, positions

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(_lifted(self.frame, self.positions))

    def nearest(self, queries: Points, limit: float = np.inf) -> Found:
        """The nearest point to each of the queries (q, 3), at most `limit` metres away."""
        if not len(self.positions):
            return Found(np.full(len(queries), -1), np.full(len(queries), np.inf))
        points = _lifted(self.frame, queries)
        bound, row = self._tree.query(points, distance_upper_bound=limit + _SLACK_M)
        row = np.where(np.isfinite(bound), row, -1).astype(np.int64)
        metres = np.where(row >= 0, distance(self.frame, queries, self.positions[row]), np.inf)
        for i in np.flatnonzero((row >= 0) & (metres > bound + _SLACK_M)):  # a long chord: another may be nearer
            close = np.sort(self._tree.query_ball_point(points[i], metres[i] + _SLACK_M)).astype(np.int64)
            exact = distance(self.frame, queries[i], self.positions[close])
            row[i], metres[i] = close[exact.argmin()], exact.min()
        return Found(np.where(metres <= limit, row, -1), np.where(metres <= limit, metres, np.inf))

    def pairs_within(self, radius: float) -> tuple[IntArray, npt.NDArray[np.float64]]:
        """All pairs (2, e) of rows a < b at most `radius` metres apart, sorted, and their metres (e,).

        Raises ConfigError when they are more than 10 million.
        """
        if not len(self.positions):
            return np.empty((2, 0), np.int64), np.empty(0)
        count = (int(self._tree.count_neighbors(self._tree, radius + _SLACK_M)) - len(self.positions)) // 2
        if count > MAX_RADIUS_EDGES:
            raise ConfigError(
                f"edge_radius {radius:g} m would join {count:,} pairs of {len(self.positions):,} nodes",
                allowed=f"at most {MAX_RADIUS_EDGES:,} radius edges",
                repair="--set map.edge_radius=METRES with a smaller radius",
            )
        index = self._tree.query_pairs(radius + _SLACK_M, output_type="ndarray").astype(np.int64).T
        index = index[:, np.lexsort((index[1], index[0]))]
        metres = distance(self.frame, self.positions[index[0]], self.positions[index[1]])
        return index[:, metres <= radius], metres[metres <= radius]


def auto_radius(frame: Frame, positions: Points) -> float:
    """1.5 times the 95th percentile of the nearest-neighbour distances of the distinct positions (n, 3), in metres.

    So nodes at equal spacing are joined, and those of a sparser stretch, but along a line no node is skipped; pairs of
    pictures taken at one spot do not shrink the radius. 0 when all positions are one.
    """
    distinct = np.unique(positions, axis=0)
    if len(distinct) < 2:
        return 0.0
    _, row = cKDTree(_lifted(frame, distinct)).query(_lifted(frame, distinct), k=2)
    metres = distance(frame, distinct, distinct[row[:, 1]])
    return RADIUS_FACTOR * float(np.percentile(metres, RADIUS_PERCENTILE))


def nearest_foreign(frame: Frame, positions: Points, label: IntArray, limit: float = np.inf) -> Found:
    """For each of the points (n, 3) the nearest one with another `label` (n,), labels counted from 0.

    Two labels differ in at least one bit. So for every bit the points that have it ask those that lack it, and the
    other way round; the least of these answers is exact, after two trees a bit.
    """
    row, metres = np.full(len(label), -1), np.full(len(label), np.inf)
    for bit in range(int(label.max(initial=0)).bit_length()):
        side = (label >> bit) & 1
        for here, there in ((np.flatnonzero(side == s), np.flatnonzero(side != s)) for s in (0, 1)):
            found = Neighbours(frame, positions[there]).nearest(positions[here], limit)
            better = found.metres < metres[here]
            row[here[better]], metres[here[better]] = there[found.row[better]], found.metres[better]
    return Found(row, metres)


def _lifted(frame: Frame, positions: Points) -> Points:
    """(n, 3) or, for WGS84, (n, 4): the Earth-centred point and the height, so that no height is lost to the tree."""
    flat = cartesian(frame, positions)
    return flat if frame is Frame.METRIC else np.hstack([flat, positions[:, 2:]])
