"""Views of one place: other places come before a further view of one that is a hit already."""

from __future__ import annotations

import numpy as np

from erag.core.geometry import distance
from erag.core.types import IntArray, TopoMap
from erag.retrieve.config import PlacesConfig
from erag.retrieve.rank import Floats
from erag.retrieve.scoring import best_first

_LOOKED = 1000  # views beyond `top` among which other places are sought


def spread(topomap: TopoMap, rows: IntArray, scores: Floats, top: int, config: PlacesConfig) -> IntArray:
    """Which `top` of the nodes `rows` (r,), best first with `scores` (r,), are hits: where they stand, ascending.

    A node within `metres` of a better one that is the best view of its place is a further view of that place, whatever
    its heading or time; in this choice it counts `further` of its score. Other places are sought among the best 1,000.
    """
    at, best, more = topomap.positions[rows], list[int](), list[int]()
    for i in range(min(len(rows), top + _LOOKED)):
        if len(best) == top:  # what follows scores less, and further views of these no more
            break
        again = (distance(topomap.frame, at[i], at[best]) <= config.metres).any()
        (more if again else best).append(i)
    found = np.array([*best, *more], np.int64)
    counts = np.repeat([1.0, config.further], [len(best), len(more)])
    return np.sort(found[best_first(scores[found] * counts, -counts, found)[:top]])
