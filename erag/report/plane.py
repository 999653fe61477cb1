"""Positions of a map on a drawing plane: whole units, north (or +y) up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.geometry import EARTH_RADIUS_M, centroid
from erag.core.types import Frame, IntArray

UNITS = 10_000  # the longer side of the drawing
MARGIN = 400  # around the outermost nodes
LEAST_EXTENT_M = 1.0
_FAR = 100 * UNITS  # a start so far off the map is drawn no further away
Points = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plane:
    """A local projection: `origin` (x, y) in the map's frame, the left and upper edge in metres from it.

    `width` and `height` are units with the margins. WGS84 is projected equirectangularly around `origin`, right across
    the antimeridian; metric frames are drawn as they are.
    """

    frame: Frame
    origin: tuple[float, float]
    left: float
    top: float
    metres_per_unit: float
    width: int
    height: int

    @classmethod
    def of(cls, frame: Frame, positions: Points) -> Plane:
        """The plane on which positions (n, 3) of `frame` fill the drawing."""
        if not len(positions):
            return cls(frame, (0.0, 0.0), 0.0, 0.0, 1.0, 2 * MARGIN, 2 * MARGIN)
        x, y, _ = centroid(frame, positions)
        origin = (x, y) if frame is Frame.WGS84 else (0.0, 0.0)
        metres = _metres(frame, origin, positions)
        low, high = metres.min(axis=0), metres.max(axis=0)
        scale = max(float((high - low).max()), LEAST_EXTENT_M) / UNITS
        width, height = (int(v) + 2 * MARGIN for v in np.rint((high - low) / scale))
        return cls(frame, origin, float(low[0]), float(high[1]), scale, width, height)

    def points(self, positions: Points) -> IntArray:
        """Units (n, 2) of positions (n, 3), y downwards as a screen has it."""
        metres = _metres(self.frame, self.origin, np.asarray(positions, np.float64).reshape(-1, 3))
        units = (metres - (self.left, self.top)) * (1, -1) / self.metres_per_unit + MARGIN
        return np.rint(np.clip(units, -_FAR, _FAR)).astype(np.int64)


def _metres(frame: Frame, origin: tuple[float, float], positions: Points) -> Points:
    """Metres (n, 2) east and north of `origin`; a metric frame's own x and y."""
    flat = positions[:, :2] - origin
    if frame is Frame.METRIC:
        return flat
    east = (flat[:, 0] + 180) % 360 - 180
    shrink = np.cos(np.radians(origin[1]))
    return np.asarray(np.radians(np.stack([east * shrink, flat[:, 1]], axis=1)) * EARTH_RADIUS_M)
