"""Where the robot's camera is, how it looks, and what one rendered frame holds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FIELD_OF_VIEW = 54.0  # degrees, vertical
NEAR, FAR = 0.08, 220.0  # metres
BODIES: dict[str, tuple[float, float]] = {  # robot -> height of the camera in metres, pitch in degrees
    "quadruped": (0.75, 2.0),
    "wheeled": (1.25, -4.0),
    "drone": (2.9, -16.0),
}


@dataclass(frozen=True, slots=True)
class Size:
    """Pixels of a picture."""

    width: int = 512
    height: int = 384


@dataclass(frozen=True, slots=True)
class Camera:
    """A pin-hole camera at (x, y, z) metres that looks along `yaw` (radians from +x), `pitch` degrees upwards."""

    x: float
    y: float
    z: float
    yaw: float
    pitch: float = 0.0

    @property
    def forward(self) -> tuple[float, float, float]:
        """The unit vector of the view."""
        p = math.radians(self.pitch)
        return (math.cos(self.yaw) * math.cos(p), math.sin(self.yaw) * math.cos(p), math.sin(p))


@dataclass(frozen=True, eq=False)
class Frame:
    """What a camera sees: `rgb` (h, w, 3) uint8, `depth` (h, w) metres, and for each pixel the row of the solid and the
    row of its material (`materials`), both −1 for the sky."""

    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    solid: npt.NDArray[np.int32]
    material: npt.NDArray[np.int32]
    materials: tuple[str, ...]

    @property
    def sky(self) -> npt.NDArray[np.bool_]:
        """(h, w) where nothing is."""
        return np.asarray(self.solid < 0)


def directions(camera: Camera, size: Size) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Azimuth and elevation in radians of every pixel's ray, each (h, w)."""
    half = math.tan(math.radians(FIELD_OF_VIEW) / 2)
    v = (1 - 2 * (np.arange(size.height) + 0.5) / size.height)[:, None] * half
    u = (1 - 2 * (np.arange(size.width) + 0.5) / size.width)[None, :] * half * size.width / size.height  # left is +
    p = math.radians(camera.pitch)
    ahead, up = math.cos(p) - v * math.sin(p), math.sin(p) + v * math.cos(p)
    ahead, up = np.broadcast_arrays(ahead, up)
    azimuth = camera.yaw + np.arctan2(u, ahead)
    return azimuth, np.arctan2(up, np.hypot(ahead, u))
