"""How many things of a name there are: views are not things, so views that may show the same one are counted once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.aware.sight import Sight
from erag.aware.things import Mention
from erag.core.types import IntArray

SAME_PLACE_M = 1.0  # objects of one name nearer than this are one
_DOUBT = 0.1  # what a view that looks at a spot and names nothing there takes away from it, in views that do
_ENOUGH = 0.6  # the spot worth adding at the least, in views that name it and are not explained by others


@dataclass(frozen=True, slots=True)
class Number:
    """About `count` things, named in `views` of `of` views; `exact` where they are nodes of their own."""

    count: int
    views: int
    of: int
    exact: bool = False


def number(mentions: Sequence[Mention], rows: IntArray, sight: Sight) -> Number:
    """How many things of one name the nodes `rows` (r,) show, given all mentions of it.

    Object nodes are counted as such, copies at one place once. Of views, the fewest spots are sought at which things
    stand such that every view that names one, or several, has as many in its wedge; spots in the wedges of views that
    name none are less likely. Without headings that is a lower bound.
    """
    inside = set(rows.tolist())
    here = [m for m in mentions if m.row in inside]
    views = int((~sight.objects[rows]).sum())
    objects = [m for m in here if sight.objects[m.row]]
    if objects:
        seen = sum(not sight.objects[m.row] for m in here)
        return Number(_apart(sight.at[[m.row for m in objects]]), seen, views, exact=True)
    return Number(_spots(here, rows, sight), len(here), views)


def _apart(at: npt.NDArray[np.float64]) -> int:
    """How many of the places (k, 2) are more than `SAME_PLACE_M` from all earlier ones that count."""
    kept: list[npt.NDArray[np.float64]] = []
    for place in at:
        if all(np.linalg.norm(place - other) >= SAME_PLACE_M for other in kept):
            kept.append(place)
    return len(kept)


def _spots(mentions: Sequence[Mention], rows: IntArray, sight: Sight) -> int:
    if not mentions:
        return 0
    candidates = np.concatenate([sight.points(m.row, m.side) for m in mentions])
    own = np.repeat(np.arange(len(mentions)), [len(sight.points(m.row, m.side)) for m in mentions])
    named = sight.covers(np.array([m.row for m in mentions], np.int64), candidates)  # (m, k)
    named &= _sides(mentions, sight, candidates)
    named[own, np.arange(len(candidates))] = True
    silent = np.array(
        [r for r in rows.tolist() if r not in {m.row for m in mentions} and not sight.objects[r]], np.int64
    )
    against = sight.covers(silent, candidates).sum(axis=0) if len(silent) else np.zeros(len(candidates))
    return _greedy(named, against, np.array([m.count for m in mentions]))


def _sides(mentions: Sequence[Mention], sight: Sight, points: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """(m, k) whether a point lies on the side of the view on which a thing was named."""
    return np.stack([sight.on_side(m.row, m.side, points) for m in mentions])


def _greedy(named: npt.NDArray[np.bool_], against: npt.NDArray[np.float64], demand: npt.NDArray[np.int64]) -> int:
    """The number of spots, best first, until every view has as many as it names."""
    left, chosen = demand.copy(), 0
    free = np.ones(named.shape[1], np.bool_)
    while (left > 0).any():
        worth = (named & (left > 0)[:, None]).sum(axis=0) - _DOUBT * against
        worth = np.where(free & named[left > 0].any(axis=0), worth, -np.inf)
        best = int(worth.argmax())
        if not np.isfinite(worth[best]) or (worth[best] < _ENOUGH and chosen):
            break
        chosen += 1
        free[best] = False
        left = np.where(named[:, best], left - 1, left)
    return max(chosen, int(demand.max()))
