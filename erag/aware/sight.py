"""What two views may show in common: each view as a wedge of the ground in front of it."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from erag.aware.things import Side
from erag.core.geometry import EARTH_RADIUS_M
from erag.core.types import Frame, IntArray, TopoMap

HALF_VIEW = math.radians(35)  # half the horizontal field of view that is assumed of a camera
STEPS, NEAREST_M, FARTHEST_M = 4.0, 8.0, 30.0  # a thing is named within so many steps of the robot, in these bounds
STOREY_M = 2.5  # higher or lower than this is another storey
_DEPTHS = np.array([0.1, 0.2, 0.32, 0.46, 0.62, 0.8, 0.97])  # shares of the reach
_TURNS = np.linspace(-0.9, 0.9, 9)  # shares of HALF_VIEW
_SIDES: dict[Side, npt.NDArray[np.float64]] = {
    "left": np.array([0.25, 0.45, 0.65, 0.85]), "centre": np.array([-0.25, 0.0, 0.25]),
    "right": np.array([-0.85, -0.65, -0.45, -0.25]),
}  # fmt: skip
Points = npt.NDArray[np.float64]


class Sight:
    """Where the nodes of a map stand and look, in metres on a plane. Nodes without heading look all round."""

    def __init__(self, topomap: TopoMap) -> None:
        self._map = topomap

    @cached_property
    def at(self) -> Points:
        """(n, 2) metres from the map's middle: east, north."""
        positions = self._map.positions
        if self._map.frame is Frame.METRIC or not len(positions):
            return positions[:, :2]
        lon, lat = np.radians(positions[:, 0]), np.radians(positions[:, 1])
        east = (np.mod(lon - lon[0] + np.pi, 2 * np.pi) - np.pi) * np.cos(np.median(lat)) * EARTH_RADIUS_M
        return np.stack([east, (lat - lat[0]) * EARTH_RADIUS_M], axis=1)

    @cached_property
    def yaw(self) -> Points:
        """(n,) headings in radians, NaN where unknown or for an object."""
        return np.array([math.nan if n.pose.yaw is None or n.kind == "object" else n.pose.yaw for n in self._map.nodes])

    @cached_property
    def objects(self) -> npt.NDArray[np.bool_]:
        """(n,) bool: nodes that are things themselves; they stand where they are and see nothing."""
        return np.array([n.kind == "object" for n in self._map.nodes], np.bool_)

    @cached_property
    def reach(self) -> float:
        """Metres within which a view is taken to name things: four steps of the robot, 8 to 30 m."""
        places = np.flatnonzero(~self.objects)
        if len(places) < 2:
            return NEAREST_M
        apart = np.linalg.norm(np.diff(self.at[places], axis=0), axis=1)
        moved = apart[apart > 0.05]
        return float(np.clip(STEPS * np.median(moved), NEAREST_M, FARTHEST_M)) if len(moved) else NEAREST_M

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.at)

    def near(self, row: int, metres: float) -> IntArray:
        """Rows of the nodes within `metres` of a node on its storey, itself among them, ascending."""
        found = np.array(sorted(self._tree.query_ball_point(self.at[row], metres)), np.int64)
        heights = self._map.positions[:, 2]
        return np.asarray(found[np.abs(heights[found] - heights[row]) < STOREY_M])

    def points(self, row: int, side: Side | None = None) -> Points:
        """(k, 2) where something seen from a node may stand; an object's own place."""
        if self.objects[row]:
            return np.asarray(self.at[row][None])
        depths = _DEPTHS * self.reach
        yaw = float(self.yaw[row])
        if math.isnan(yaw):
            turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        else:
            turns = yaw + HALF_VIEW * (_TURNS if side is None else _SIDES[side])
        ahead = np.stack([np.cos(turns), np.sin(turns)], axis=1)  # (t, 2)
        return np.asarray(self.at[row] + (depths[:, None, None] * ahead[None]).reshape(-1, 2))

    def covers(self, rows: IntArray, points: Points) -> npt.NDArray[np.bool_]:
        """(r, k) bool: which of the points (k, 2) lie in the wedges of the views `rows` (r,)."""
        apart = points[None] - self.at[rows][:, None]  # (r, k, 2)
        metres = np.linalg.norm(apart, axis=2)
        turn = np.arctan2(apart[..., 1], apart[..., 0]) - self.yaw[rows][:, None]
        off = np.abs(np.mod(turn + np.pi, 2 * np.pi) - np.pi)
        ahead = np.isnan(off) | (off <= HALF_VIEW) | (metres < 0.5)
        return np.asarray(ahead & (metres <= self.reach) & ~self.objects[rows][:, None])

    def on_side(self, row: int, side: Side | None, points: Points) -> npt.NDArray[np.bool_]:
        """(k,) bool: which of the points (k, 2) lie on a side of the view of a node; all where no side is said."""
        yaw = float(self.yaw[row])
        if side is None or math.isnan(yaw):
            return np.ones(len(points), np.bool_)
        apart = points - self.at[row]
        turn = np.mod(np.arctan2(apart[:, 1], apart[:, 0]) - yaw + np.pi, 2 * np.pi) - np.pi
        share = turn / HALF_VIEW
        low, high = {"left": (0.1, 1.1), "centre": (-0.4, 0.4), "right": (-1.1, -0.1)}[side]
        return np.asarray((share >= low) & (share <= high))
