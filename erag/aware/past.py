"""Sightings of a thing in time: the last, the first, what was looked at since, and whether it is still there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from erag.aware.changes import Alike, Changes, Comparison
from erag.aware.distinct import Number, number
from erag.aware.sight import Sight
from erag.aware.things import Mention, Name, Things, alike
from erag.aware.visits import Visit
from erag.core.types import IntArray, TopoMap

EPISODE_S = 600.0  # sightings within ten minutes of each other are one


@dataclass(frozen=True, slots=True)
class Sighting:
    """A moment at which a thing was seen: the node `row`, and the rows of later views of the spot that miss it."""

    row: int
    seconds: float
    missed: tuple[int, ...] = ()


class Past:
    """What a map's texts and times say of things. Nothing is computed before it is asked for.

    `same` says which names may be one thing though they are worded differently.
    """

    def __init__(self, topomap: TopoMap, texts: Sequence[str], visits: Sequence[Visit], same: Alike = alike) -> None:
        self._map, self.visits, self._same = topomap, tuple(visits), same
        self.things, self.sight = Things(topomap, texts), Sight(topomap)

    @cached_property
    def times(self) -> npt.NDArray[np.float64]:
        """(n,) when each node was seen, in UTC seconds; NaN where unknown."""
        return np.array([n.time.start if n.time else np.nan for n in self._map.nodes], np.float64)

    def mentions(self, name: Name, eligible: npt.NDArray[np.bool_]) -> tuple[Mention, ...]:
        """The mentions of a thing by nodes `eligible` (n,), the latest first; those of unknown time last."""
        found = [m for m in self.things.of(name) if eligible[m.row]]
        return tuple(sorted(found, key=lambda m: (-np.nan_to_num(self.times[m.row], nan=-np.inf), m.row)))

    def last(self, mentions: Sequence[Mention]) -> Sighting | None:
        """The last sighting among mentions; of those within ten minutes of it the one that tells of the thing first."""
        timed = [m for m in mentions if np.isfinite(self.times[m.row])]
        return self._sighting(max(timed, key=lambda m: (self.times[m.row], -m.row))) if timed else None

    def first(self, mentions: Sequence[Mention]) -> Sighting | None:
        """The first sighting among mentions."""
        timed = [m for m in mentions if np.isfinite(self.times[m.row])]
        best = min(timed, key=lambda m: (self.times[m.row], m.row), default=None)
        return None if best is None else Sighting(best.row, float(self.times[best.row]))

    def _sighting(self, mention: Mention) -> Sighting:
        """With the views of later visits that look at the spot without naming the thing."""
        seconds = float(self.times[mention.row])
        later = [v.rows for v in self.visits if v.start > seconds]
        if not later:
            return Sighting(mention.row, seconds)
        rows = np.sort(np.concatenate(later))
        near = self.sight.near(mention.row, 2 * self.sight.reach)
        near = near[np.isin(near, rows)]
        points = self.sight.points(mention.row, mention.side)
        looks = self.sight.covers(near, points).mean(axis=1) > 0.3 if len(near) else np.zeros(0, np.bool_)
        return Sighting(mention.row, seconds, tuple(int(r) for r in near[looks]))

    def number(self, name: Name, rows: IntArray) -> Number:
        """About how many things of a name the nodes `rows` (r,) show."""
        return number(self.things.of(name), rows, self.sight)

    def changes(self, before: Visit, after: Visit) -> Changes:
        """What changed from one visit to another."""
        key = (before.number, after.number)
        if key not in self._compared:
            self._compared[key] = Comparison(self.things, self.sight, self._same).between(before.rows, after.rows)
        return self._compared[key]

    @cached_property
    def _compared(self) -> dict[tuple[int, int], Changes]:
        return {}

    def compared(self, since: float | None, until: float | None = None) -> tuple[Visit, Visit] | None:
        """The visits that a comparison is about: the last before `since` (else the last but one), and the newest.

        With `until` the newest that began before it. None where there are not two visits.
        """
        known = [v for v in self.visits if until is None or v.start < until]
        if len(known) < 2:
            return None
        earlier = [v for v in known[:-1] if since is None or v.start < since]
        return (earlier or known[:1])[-1], known[-1]
