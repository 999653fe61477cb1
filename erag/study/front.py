"""Which of several choices are worth having, and where the front of them bends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
RULE = (
    "the point of the Pareto front that lies farthest below the straight line between the front's ends, "
    "with log bytes and loss each scaled to [0, 1]; of a front that bends nowhere the point of least loss"
)


def front(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """The names whose (bytes, loss) no other point betters in both, from small to large."""
    kept: list[str] = []
    best = np.inf
    for name in sorted(points, key=lambda n: (points[n], n)):
        if points[name][1] < best:
            kept.append(name)
            best = points[name][1]
    return kept


def knee(points: Mapping[str, tuple[float, float]]) -> str:
    """The knee of the front by `RULE`; of a front that bends nowhere its best. Raises ValueError for no point."""
    names = front(points)
    if not names:
        raise ValueError("a knee of no points")
    if len(names) < 3:
        return names[-1]
    size = _scaled([float(np.log(points[name][0])) for name in names])
    loss = _scaled([points[name][1] for name in names])
    below = 1 - size - loss  # the line from (0, 1) to (1, 0): how far each point lies under it
    best = int(np.argmax(below))
    return names[best] if below[best] > 1e-9 else names[-1]


def _scaled(values: Sequence[float]) -> Floats:
    found = np.array(values, np.float64)
    return np.asarray((found - found.min()) / max(float(np.ptp(found)), 1e-12))
