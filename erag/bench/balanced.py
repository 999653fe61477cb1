"""A forest by place alone, for maps so large that the builder takes too long."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from erag.core.types import NO_PARENT, Cluster, Forest, IntArray, TopoMap
from erag.forest.affinity import unit_rows
from erag.forest.config import ShrinkCuts
from erag.lm.roles import Vectors

_BITS = 21  # of a coordinate in Morton order


def balanced_forest(topomap: TopoMap, vectors: Vectors) -> Forest:
    """A forest with the builder's ratios in which the clusters of a level have the same size, ±1.

    Nodes are put in Morton order, where neighbours are near each other: 16 in a row are a cluster, 4.5 of these in a
    row (on average) a cluster of the next level, up to one root. A cluster's vector is the unit mean of its nodes'
    `vectors` (n, d), its position their centroid in metres; `mean_distance` is not measured and 0.
    """
    n, rows = len(topomap), morton_order(topomap.positions[:, :2])
    clusters, parent, level, tables = list[Cluster](), [np.full(n, NO_PARENT)], [np.zeros(n, np.int64)], [vectors]
    ids = [node.id for node in topomap.nodes]
    sums, places, sizes = vectors[rows], topomap.positions[rows], np.ones(len(rows))
    for depth, first in enumerate(_levels(n), 1):
        sums, places, sizes = (np.add.reduceat(part, first, axis=0) for part in (sums, places, sizes))
        start, groups = len(ids), np.split(rows, first[1:])
        centres = (places / sizes[:, None]).tolist()
        new = [
            Cluster(f"L{depth}-{i}", depth, tuple(ids[row] for row in group), (x, y, z), 0.0)
            for i, (group, (x, y, z)) in enumerate(zip(groups, centres, strict=True))
        ]
        _adopt(parent[-1], rows - (start - len(parent[-1])), groups, start)
        parent.append(np.full(len(new), NO_PARENT))
        level.append(np.full(len(new), depth))
        tables.append(unit_rows(sums).astype(np.float32))
        clusters += new
        ids += [c.id for c in new]
        rows = np.arange(start, len(ids))
    return Forest(
        tuple(ids[:n]), tuple(clusters), np.concatenate(parent), np.concatenate(level), np.concatenate(tables)
    )


def _adopt(parent: IntArray, rows: IntArray, groups: list[IntArray], start: int) -> None:
    """Write into `parent` (r,) of one level who holds its `rows`, in their order: the clusters from `start` on."""
    parent[rows] = start + np.repeat(np.arange(len(groups)), [len(group) for group in groups])


def _levels(rows: int) -> Iterator[IntArray]:
    """For each level where its groups begin among the `rows` below."""
    cuts, level = ShrinkCuts(), 1
    while rows > 1:
        count = max(1, round(rows / cuts.ratio(level)))
        yield -(-np.arange(count) * rows // count)
        rows, level = count, level + 1


def morton_order(positions: npt.NDArray[np.float64]) -> IntArray:
    """The order (n,) of positions (n, 2) along the Z curve through the square that holds them."""
    extent = max(float(np.ptp(positions, axis=0).max(initial=0.0)), 1e-9) if len(positions) else 1.0
    cells = ((positions - positions.min(0)) / extent * (2**_BITS - 1)).astype(np.int64)
    code = np.zeros(len(positions), np.int64)
    for bit in range(_BITS):
        code |= ((cells[:, 0] >> bit) & 1) << (2 * bit)
        code |= ((cells[:, 1] >> bit) & 1) << (2 * bit + 1)
    return np.argsort(code, kind="stable")
