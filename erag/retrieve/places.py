"""Views of one place: of the hits that stand together the best is kept."""

from __future__ import annotations

import numpy as np

from erag.core.geometry import distance
from erag.core.types import IntArray, TopoMap


def best_views(topomap: TopoMap, rows: IntArray, metres: float, top: int) -> IntArray:
    """Where in the nodes `rows` (r,), best first, the best views of the first `top` places stand, (k,) ascending.

    A node within `metres` of a better view that was kept is another view of its place, whatever its heading or time.
    """
    at = topomap.positions[rows]
    kept: list[int] = []
    for i in range(len(rows)):
        if len(kept) == top:
            break
        if not (distance(topomap.frame, at[i], at[kept]) <= metres).any():
            kept.append(i)
    return np.array(kept, np.int64)
