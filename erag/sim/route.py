"""The robot's way through a world: nodes at equal distances along its path, and where it looks from each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from erag.sim.camera import BODIES, Camera
from erag.sim.scene import Box, Path, Point2

VIEW = 40.0  # metres within which a robot turns to something
WIDEST = 14.0  # metres from the middle of an obstacle to its edge, at most
BESIDE = 0.45  # metres a robot keeps from what it drives round
SMALLEST, LARGEST = 0.15, 0.75  # half the extent of a target over its distance


@dataclass(frozen=True, slots=True)
class Stop:
    """A node of the path: its number, metres driven so far, and the camera there."""

    index: int
    metres: float
    camera: Camera


class Nearby:
    """Finds the rows of the points within a radius in metres."""

    def __init__(self, points: Sequence[Point2], radius: float) -> None:
        self._tree = cKDTree(np.array(points).reshape(-1, 2)) if points else None
        self._radius = radius

    def __call__(self, at: Point2) -> list[int]:
        return sorted(self._tree.query_ball_point(at, self._radius)) if self._tree is not None else []


@dataclass(frozen=True, slots=True)
class Target:
    """Something a robot may turn to: where it is, half its extent, and the row of its area (−1: outdoors)."""

    x: float
    y: float
    size: float
    room: int


def stops(
    path: Path, robot: str, targets: Sequence[Target], obstacles: Sequence[Box], rooms: Callable[[Point2], int]
) -> tuple[Stop, ...]:
    """`path.nodes` stops at equal distances from the first corner to the last, beside the obstacles on the way.

    `rooms` says in which room a point lies (−1: in none): a robot turns only to targets in the room it is in.
    """
    height, pitch = BODIES[robot]
    legs = [math.dist(a, b) for a, b in pairwise(path.points)]
    step = sum(legs) / (path.nodes - 1)
    looked: Counter[int] = Counter()
    around, beside = Nearby([(t.x, t.y) for t in targets], VIEW), Nearby([_centre(b) for b in obstacles], WIDEST)
    found: list[Stop] = []
    driven = 0.0
    for i in range(path.nodes):
        at, heading = _at(path.points, legs, min(i * step, sum(legs) - 1e-9))
        at = _aside(at, [obstacles[i] for i in beside(at)])
        driven += math.dist(at, (found[-1].camera.x, found[-1].camera.y)) if found else 0.0
        look = path.look[i % len(path.look)]
        turned = look == "thing"
        yaw = (
            _towards(at, {i: targets[i] for i in around(at)}, rooms(at), looked, heading)
            if turned
            else heading + math.radians(float(look))
        )
        camera = Camera(
            round(float(at[0]), 4), round(float(at[1]), 4), height, round(math.remainder(yaw, 2 * math.pi), 6), pitch
        )
        found.append(Stop(i, round(driven, 3), camera))
    return tuple(found)


def _towards(at: Point2, targets: Mapping[int, Target], room: int, looked: Counter[int], heading: float) -> float:
    """The direction of the target near `at` that was looked at least, the largest to the eye first."""
    best, key = -1, (math.inf, 0.0)
    for row, t in targets.items():
        apparent = t.size / max(math.dist(at, (t.x, t.y)), 1e-6)
        if t.room == room and SMALLEST < apparent < LARGEST and (looked[row], -apparent) < key:
            best, key = row, (looked[row], -apparent)
    if best < 0:
        return heading
    looked[best] += 1
    return math.atan2(targets[best].y - at[1], targets[best].x - at[0])


def _centre(box: Box) -> Point2:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def _aside(at: Point2, obstacles: Sequence[Box]) -> Point2:
    """`at` if nothing stands there, else the nearest of the points on rings around it where nothing does."""

    def free(p: Point2) -> bool:
        return not any(
            x0 - BESIDE < p[0] < x1 + BESIDE and y0 - BESIDE < p[1] < y1 + BESIDE for x0, y0, x1, y1 in obstacles
        )

    rings = ((0.25 * r, t * math.pi / 8) for r in range(1, 24) for t in range(16))
    around = ((at[0] + r * math.cos(t), at[1] + r * math.sin(t)) for r, t in rings)
    return at if free(at) else next((p for p in around if free(p)), at)


def clearance(path: Path, point: Point2) -> float:
    """Metres from a point to the nearest leg of the path."""
    return min(_distance(point, a, b) for a, b in pairwise(path.points))


def _at(points: Sequence[Point2], legs: Sequence[float], metres: float) -> tuple[Point2, float]:
    for (a, b), leg in zip(pairwise(points), legs, strict=True):
        if metres < leg:
            t = metres / leg
            heading = math.atan2(b[1] - a[1], b[0] - a[0])
            return (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t), heading
        metres -= leg
    raise ValueError(f"{metres} m beyond the end of the path")


def _distance(p: Point2, a: Point2, b: Point2) -> float:
    length = math.dist(a, b) ** 2
    t = 0.0 if length == 0 else ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / length
    t = min(1.0, max(0.0, t))
    return math.dist(p, (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
