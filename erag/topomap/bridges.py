"""The bridge rule: the shortest edges that join the components of a map."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from erag.core.geometry import Points
from erag.core.types import Frame, IntArray
from erag.topomap.neighbours import nearest_foreign


def components(n: int, index: IntArray) -> tuple[int, IntArray]:
    """Number of components of n nodes under the edges (2, e), and each node's (n,), counted from 0 by first row."""
    ones = np.ones(index.shape[1], np.int8)
    count, label = connected_components(coo_array((ones, (index[0], index[1])), shape=(n, n)).tocsr(), directed=False)
    return int(count), label.astype(np.int64)


def bridges(
    frame: Frame, positions: Points, label: IntArray, max_metres: float | None
) -> tuple[IntArray, npt.NDArray[np.float64]]:
    """The edges (2, b) and metres (b,) of a minimum spanning tree over the components `label` (n,) of points (n, 3).

    Edges longer than `max_metres` are left out; what they would join stays apart. Borůvka's method: in every round
    each component takes its shortest edge to another one, and edges that would close a ring are dropped.
    """
    limit = np.inf if max_metres is None else max_metres
    made: list[IntArray] = [np.empty((2, 0), np.int64)]
    lengths: list[npt.NDArray[np.float64]] = [np.empty(0)]
    while True:
        index, metres = _shortest_out(frame, positions, label, limit)
        keep = _without_rings(label[index])
        if not keep.any():
            return np.concatenate(made, axis=1), np.concatenate(lengths)
        made.append(index[:, keep])
        lengths.append(metres[keep])
        label = components(int(label.max()) + 1, label[index[:, keep]])[1][label]


def _shortest_out(
    frame: Frame, positions: Points, label: IntArray, limit: float
) -> tuple[IntArray, npt.NDArray[np.float64]]:
    """Each component's shortest edge (2, c) out of it, and metres (c,), shortest first."""
    row, metres = nearest_foreign(frame, positions, label, limit)
    start = np.flatnonzero(row >= 0)
    low, high = np.minimum(start, row[start]), np.maximum(start, row[start])
    order = np.lexsort((high, low, metres[start]))
    _, first = np.unique(label[start][order], return_index=True)
    chosen = order[np.sort(first)]
    return np.stack([low[chosen], high[chosen]]), metres[start][chosen]


def _without_rings(pairs: IntArray) -> npt.NDArray[np.bool_]:
    """(c,) bool: the pairs (2, c) of labels that, taken in order, join two trees rather than close a ring."""
    root: dict[int, int] = {}

    def find(label: int) -> int:
        while (up := root.get(label, label)) != label:
            root[label] = root.get(up, up)
            label = up
        return label

    keep = np.zeros(pairs.shape[1], np.bool_)
    for i, (a, b) in enumerate(pairs.T.tolist()):
        low, high = sorted((find(a), find(b)))
        keep[i] = low != high
        root[high] = low
    return keep
