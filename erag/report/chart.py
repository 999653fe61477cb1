"""The map as shapes of an SVG drawing, in whole units of its plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erag.core.types import NO_PARENT, EdgeKind, Edges, Forest, IntArray, TopoMap
from erag.report.plane import Plane

HUES = 48  # colours that tell clusters apart
GOLDEN_ANGLE = 137.508  # degrees: neighbours in a series of hues are far apart on the colour circle


@dataclass(frozen=True, slots=True)
class Strokes:
    """All edges of a kind as one path."""

    kind: str
    count: int
    path: str


@dataclass(frozen=True, slots=True)
class Dot:
    """A node: its row and where it is drawn."""

    row: int
    x: int
    y: int
    is_object: bool


@dataclass(frozen=True, slots=True)
class Dots:
    """The nodes right below a cluster; `hue` is None for those that no cluster took up."""

    hue: int | None
    dots: tuple[Dot, ...]


@dataclass(frozen=True, slots=True)
class Chart:
    """What is drawn: the plane, edges by kind, and nodes by cluster. `points` (n, 2) and `centres` (c, 2) are units."""

    plane: Plane
    strokes: tuple[Strokes, ...]
    groups: tuple[Dots, ...]
    points: IntArray
    centres: IntArray


def chart(topomap: TopoMap, forest: Forest) -> Chart:
    """The drawing of a map whose nodes are the leaves of `forest`."""
    plane = Plane.of(topomap.frame, topomap.positions)
    points = plane.points(topomap.positions)
    centres = np.array([c.position for c in forest.clusters], np.float64).reshape(-1, 3)
    return Chart(
        plane, _strokes(topomap.edges, points), _groups(topomap, forest, points), points, plane.points(centres)
    )


def hue_of(cluster: int) -> int:
    """The number of the colour of a cluster, given its place among the clusters."""
    return cluster % HUES


def palette() -> str:
    """The style rules of the colours: hues a golden angle apart, in three shades."""
    rules = (f".h{i}{{--hue:{i * GOLDEN_ANGLE % 360:.0f};--shade:{i % 3 - 1}}}" for i in range(HUES))
    return "".join(rules)


def _strokes(edges: Edges, points: IntArray) -> tuple[Strokes, ...]:
    """One path a kind, without the kinds that have no edge."""
    found = []
    for kind in EdgeKind:
        index = edges.index[:, edges.kind == kind]
        if index.shape[1]:
            found.append(Strokes(kind.name.lower(), index.shape[1], _path(points[index[0]], points[index[1]])))
    return tuple(found)


def _path(starts: IntArray, ends: IntArray) -> str:
    """Segments from `starts` (e, 2) to `ends` (e, 2): `Mx yldx dy…`."""
    rows = np.concatenate([starts, ends - starts], axis=1).tolist()
    return "".join(f"M{x} {y}l{dx} {dy}" for x, y, dx, dy in rows)


def _groups(topomap: TopoMap, forest: Forest, points: IntArray) -> tuple[Dots, ...]:
    """The nodes by their own cluster, in the order of the clusters."""
    parent = forest.parent[: forest.n_leaves]
    found = []
    for above in np.unique(parent):
        rows = np.flatnonzero(parent == above)
        dots = tuple(
            Dot(int(row), int(x), int(y), topomap.nodes[row].kind == "object")
            for row, (x, y) in zip(rows, points[rows], strict=True)
        )
        found.append(Dots(None if above == NO_PARENT else hue_of(int(above) - forest.n_leaves), dots))
    return tuple(found)
