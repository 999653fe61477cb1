"""Triangle meshes and the primitives that objects are built from; metres, z up, texture coordinates in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Point = tuple[float, float, float]
ORIGIN: Point = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Mesh:
    """`vertices`, `normals` (n, 3), `uvs` (n, 2) in metres or, where fitted, in 0..1; `faces` (f, 3) rows."""

    vertices: Array
    normals: Array
    uvs: Array
    faces: npt.NDArray[np.int64]

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """This mesh shifted by metres."""
        return replace(self, vertices=self.vertices + np.array((x, y, z)))

    def turned(self, degrees: float, axis: str = "z") -> Mesh:
        """This mesh turned counter-clockwise about the x, y or z axis through the origin."""
        rotation = _rotation(degrees, axis)
        return replace(self, vertices=self.vertices @ rotation.T, normals=self.normals @ rotation.T)

    def scaled(self, x: float, y: float, z: float) -> Mesh:
        """This mesh stretched about the origin, by positive factors."""
        normals = self.normals / (x, y, z)
        return replace(self, vertices=self.vertices * (x, y, z), normals=_unit(normals))


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of all `meshes`."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.uvs for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
    )


def box(dx: float, dy: float, dz: float, at: Point = ORIGIN, *, fit: bool = False) -> Mesh:
    """A box of size (dx, dy, dz) whose bottom face is centred at `at`; `fit` stretches the texture over each face."""
    half = np.array((dx, dy, dz)) / 2
    quads = []
    for axis in range(3):
        u, v = [(1, 2), (0, 2), (0, 1)][axis]
        for sign in (-1.0, 1.0):
            handed = sign * (1.0 if axis != 1 else -1.0)  # so that texture reads from left to right from outside
            corners = np.zeros((4, 3))
            corners[:, axis] = sign * half[axis]
            corners[:, u] = np.array((-1, 1, 1, -1)) * half[u] * handed
            corners[:, v] = np.array((-1, -1, 1, 1)) * half[v]
            extent = (1.0, 1.0) if fit else (2 * half[u], 2 * half[v])
            quads.append(quad(corners + np.array((0, 0, half[2])), extent))
    return merge(quads).moved(*at)


def quad(corners: npt.ArrayLike, extent: tuple[float, float] = (1.0, 1.0)) -> Mesh:
    """Four corners, counter-clockwise seen from outside, the first at the texture's lower left."""
    points = np.asarray(corners, np.float64)
    normal = _unit(np.cross(points[1] - points[0], points[2] - points[0])[None])
    uvs = np.array(((0, 0), (1, 0), (1, 1), (0, 1)), np.float64) * extent
    return Mesh(points, np.repeat(normal, 4, 0), uvs, np.array(((0, 1, 2), (0, 2, 3))))


def panel(width: float, height: float, at: Point = ORIGIN, facing: float = 0.0) -> Mesh:
    """An upright picture, fitted, facing +x turned by `facing` degrees; `at` is the middle of its lower edge."""
    w = width / 2
    corners = ((0, -w, 0), (0, w, 0), (0, w, height), (0, -w, height))
    return quad(corners).turned(facing).moved(*at)


def sheet(dx: float, dy: float, at: Point = ORIGIN, *, fit: bool = False) -> Mesh:
    """A level rectangle seen from above, centred at `at`."""
    x, y = dx / 2, dy / 2
    return quad(((-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)), (1.0, 1.0) if fit else (dx, dy)).moved(*at)


def lathe(profile: Sequence[tuple[float, float]], at: Point = ORIGIN, sides: int = 14) -> Mesh:
    """A surface of revolution about z through `at`; `profile` are (radius, height) pairs from bottom to top."""
    bands = [_band(a, b, sides) for a, b in pairwise(profile)]
    return merge(bands).moved(*at)


def cylinder(radius: float, height: float, at: Point = ORIGIN, *, top: float | None = None, sides: int = 14) -> Mesh:
    """A closed upright cylinder standing at `at`; with `top`, another radius there: a cone or a frustum."""
    r2 = radius if top is None else top
    return lathe(((0.0, 0.0), (radius, 0.0), (r2, height), (0.0, height)), at, sides)


def rod(a: Point, b: Point, radius: float, sides: int = 8) -> Mesh:
    """A round bar from `a` to `b`."""
    start, along = np.array(a), np.array(b) - np.array(a)
    length = float(np.linalg.norm(along))
    mesh = cylinder(radius, length, sides=sides)
    tilt = math.degrees(math.atan2(math.hypot(along[0], along[1]), along[2]))
    return mesh.turned(tilt, "y").turned(math.degrees(math.atan2(along[1], along[0]))).moved(*start)


def bars(points: Sequence[Point], radius: float, sides: int = 8) -> Mesh:
    """Round bars joining the points one after another."""
    return merge([rod(a, b, radius, sides) for a, b in pairwise(points)])


def wheel(radius: float, width: float, at: Point) -> Mesh:
    """A wheel whose axle lies along y, centred at `at`."""
    return cylinder(radius, width, (0, 0, -width / 2), sides=16).turned(90, "x").moved(*at)


def ring(radius: float, thickness: float, at: Point = ORIGIN, sides: int = 16) -> Mesh:
    """A thin hoop in the x-z plane, centred at `at`: a bicycle's tyre."""
    angles = np.linspace(0, 2 * math.pi, sides + 1)
    points: list[Point] = [(radius * math.cos(t), 0.0, radius * math.sin(t)) for t in angles]
    return bars(points, thickness, 5).moved(*at)


def sphere(radius: float, at: Point = ORIGIN, squash: Point = (1.0, 1.0, 1.0), sides: int = 12) -> Mesh:
    """An ellipsoid centred at `at`, of half axes radius·squash."""
    steps = np.linspace(-math.pi / 2, math.pi / 2, max(4, sides // 2) + 1)
    ball = lathe([(radius * math.cos(t), radius * math.sin(t)) for t in steps], sides=sides)
    return replace(ball, normals=_unit(ball.vertices + 1e-9)).scaled(*squash).moved(*at)


def blob(radius: float, at: Point, rng: np.random.Generator, rough: float = 0.18) -> Mesh:
    """A sphere with dents, for foliage and rocks."""
    ball = sphere(radius, sides=12)
    keys = np.round(ball.vertices / radius, 3) @ (13.7, 7.9, 3.1)  # equal for the vertices of one point
    dents = 1.0 + rough * np.sin(keys * 9.0 + rng.uniform(0, 6.3)) * rng.uniform(0.6, 1.0)
    return replace(ball, vertices=ball.vertices * dents[:, None]).moved(*at)


def prism(outline: Sequence[tuple[float, float]], width: float, at: Point = ORIGIN) -> Mesh:
    """An outline in the x-z plane, counter-clockwise seen from -y, extruded to `width` along y.

    The outline has to be star-shaped about its centroid.
    """
    flat = np.array([(x, 0.0, z) for x, z in outline])
    near, far = flat - np.array((0, width / 2, 0)), flat + np.array((0, width / 2, 0))
    sides = []
    for i in range(len(flat)):
        j = (i + 1) % len(flat)
        length = float(np.linalg.norm(flat[j] - flat[i]))
        sides.append(quad((near[j], near[i], far[i], far[j]), (length, width)))
    return merge([*sides, _fan(near, -1.0), _fan(far, 1.0)]).moved(*at)


def bounds(meshes: Sequence[Mesh]) -> tuple[Array, Array]:
    """The lowest and highest corner (3,) of the meshes."""
    points = np.concatenate([m.vertices for m in meshes])
    return points.min(0), points.max(0)


def _fan(ring_: Array, sign: float) -> Mesh:
    n = len(ring_)
    points = np.concatenate([ring_, ring_.mean(0, keepdims=True)])
    faces = np.array([(i, (i + 1) % n, n) for i in range(n)])
    normals = np.tile((0.0, sign, 0.0), (n + 1, 1))
    return Mesh(points, normals, points[:, (0, 2)].copy(), faces if sign < 0 else faces[:, ::-1])


def _band(a: tuple[float, float], b: tuple[float, float], sides: int) -> Mesh:
    (r1, z1), (r2, z2) = a, b
    t = np.linspace(0, 2 * math.pi, sides + 1)
    circle = np.stack([np.cos(t), np.sin(t)], 1)
    low = np.column_stack([circle * r1, np.full(sides + 1, z1)])
    high = np.column_stack([circle * r2, np.full(sides + 1, z2)])
    slant = math.hypot(r2 - r1, z2 - z1) or 1e-9
    normals = np.column_stack([circle * (z2 - z1) / slant, np.full(sides + 1, (r1 - r2) / slant)])
    around = t * max(r1, r2)
    base = 0.0 if abs(z2 - z1) < 1e-9 else z1
    uvs = np.concatenate([np.stack([around, np.full_like(t, v)], 1) for v in (base, base + slant)])
    i = np.arange(sides)
    lower = np.stack([i, i + 1, i + sides + 2], 1)
    upper = np.stack([i, i + sides + 2, i + sides + 1], 1)
    return Mesh(np.concatenate([low, high]), np.concatenate([normals, normals]), uvs, np.concatenate([lower, upper]))


def _rotation(degrees: float, axis: str) -> Array:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrices: dict[str, Any] = {
        "x": ((1, 0, 0), (0, c, -s), (0, s, c)),
        "y": ((c, 0, s), (0, 1, 0), (-s, 0, c)),
        "z": ((c, -s, 0), (s, c, 0), (0, 0, 1)),
    }
    return np.array(matrices[axis], np.float64)


def _unit(rows: Array) -> Array:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12))
