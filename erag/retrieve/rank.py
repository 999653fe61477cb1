"""Location, sensors and time: masks and scores in [0, 1] that join the semantic score (paper, phase 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.geometry import centroid, distance
from erag.core.types import IntArray, Pose, Range, SensorWish, TopoMap
from erag.retrieve.scoring import Mask

Floats = npt.NDArray[np.float64]
_DAY_S = 86_400.0


class Distances(Protocol):
    """Distances for a robot: along the map's edges where both ends are connected, else the straight line."""

    def path_or_straight(self, start: Pose, rows: IntArray, /) -> tuple[Floats, Mask]:
        """Metres (r,) from a pose to nodes `rows` (r,), and whether they were measured along edges (r,)."""
        ...


class StraightLines:
    """Distances on a map whose edges are not used."""

    def __init__(self, topomap: TopoMap) -> None:
        self._map = topomap

    def path_or_straight(self, start: Pose, rows: IntArray, /) -> tuple[Floats, Mask]:
        """See `Distances`."""
        metres = distance(self._map.frame, np.array(start.xyz), self._map.positions[rows])
        return metres, np.zeros(len(rows), np.bool_)


def auto_theta(topomap: TopoMap) -> float:
    """The median distance in metres of the nodes from their centre: half the map scores below 1/e from there.

    1 m for a map without extent.
    """
    if not len(topomap):
        return 1.0
    centre = np.array(centroid(topomap.frame, topomap.positions))
    median = float(np.median(distance(topomap.frame, centre, topomap.positions)))
    return median if median > 0 else 1.0


@dataclass(frozen=True)
class Times:
    """When the nodes were observed: `start` and `end` (n,) in UTC seconds, NaN where unknown."""

    start: Floats
    end: Floats

    @classmethod
    def of(cls, topomap: TopoMap) -> Times:
        spans = [(n.time.start, n.time.end) if n.time else (np.nan, np.nan) for n in topomap.nodes]
        start, end = np.array(spans, np.float64).reshape(-1, 2).T
        return cls(start, end)

    @cached_property
    def known(self) -> Mask:
        """(n,) bool."""
        return np.isfinite(self.start)

    def within(self, since: float | None, until: float | None, hours: Range | None = None) -> Mask:
        """(n,) bool: some moment of the node lies in [since, until), as `Interval.overlaps`; unknown times do not.

        With `hours` of the day [from, to) in UTC it also has to begin in them; over midnight where from >= to, and
        nodes known to a day at best do not.
        """
        low, high = -np.inf if since is None else since, np.inf if until is None else until
        inside = ((self.end > low) | (self.start >= low)) & (self.start < high)
        return inside if hours is None else inside & self._in_hours(*hours)

    def _in_hours(self, first: float, last: float) -> Mask:
        exact = self.end - self.start < _DAY_S
        hour = np.mod(np.where(exact, self.start, 0.0), _DAY_S) / 3600
        if first < last:
            return exact & (hour >= first) & (hour < last)
        return exact & ((hour >= first) | (hour < last))


class Sensors:
    """Readings of all nodes, and how well they meet a wish."""

    def __init__(self, topomap: TopoMap, declared: Mapping[str, Range]) -> None:
        self._map, self._declared = topomap, declared
        self._readings: dict[str, Floats] = {}

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """All channels that are declared or read anywhere, by name."""
        return tuple(sorted({c for node in self._map.nodes for c in node.sensors} | set(self._declared)))

    def readings(self, channel: str) -> Floats:
        """(n,) readings, NaN where there is none."""
        if channel not in self._readings:
            found = np.array([node.sensors.get(channel, np.nan) for node in self._map.nodes], np.float64)
            self._readings[channel] = np.where(np.isfinite(found), found, np.nan)
        return self._readings[channel]

    def score(self, channel: str, wish: SensorWish, where: str) -> Floats:
        """(n,) in [0, 1], NaN without a reading: how well a channel meets a wish.

        `low` and `high` go by the map's own distribution: 1 in the third of its readings at that end, 0 in the third at
        the other, linear by rank between; 0.5 where all are equal. Within (low, high) a reading scores 1 and outside it
        loses linearly with the distance, in units of the declared, else the observed, range. Raises InputError for an
        unknown channel or an empty wish.
        """
        if channel not in self.channels:
            known = ", ".join(self.channels) or "none: this map has no readings"
            raise InputError(f"no sensor channel {channel!r}", where=where, allowed=known)
        readings = self.readings(channel)
        if not isinstance(wish, str):
            low, high = self._declared.get(channel) or _observed(readings)
            return _within(readings, wish, high - low, f"{where}, sensor {channel}")
        high_end = np.clip(3 * _below(readings) - 1, 0, 1)
        return 1 - high_end if wish == "low" else high_end


def _below(readings: Floats) -> Floats:
    """(n,) the share of the known readings below each, equal ones half; NaN without a reading."""
    known = np.sort(readings[np.isfinite(readings)])
    if not len(known):
        return readings
    under, upto = np.searchsorted(known, readings, "left"), np.searchsorted(known, readings, "right")
    return np.where(np.isfinite(readings), (under + upto) / (2 * len(known)), np.nan)


def _observed(readings: Floats) -> Range:
    known = readings[np.isfinite(readings)]
    return (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)


def _within(readings: Floats, wish: Range, extent: float, where: str) -> Floats:
    low, high = wish
    if not low <= high:
        raise InputError(f"the range [{low}, {high}] is empty", where=where, allowed="[min, max] with min <= max")
    outside = np.maximum(np.maximum(low - readings, readings - high), 0.0)  # NaN where there is no reading
    if extent > 0:
        return np.clip(1 - outside / extent, 0, 1)
    return np.where(np.isnan(outside), np.nan, outside == 0)


def mean_known(scores: list[Floats], n: int) -> Floats:
    """(n,) mean over the channels that have a reading, NaN where none has."""
    stacked = np.array(scores, np.float64).reshape(-1, n)
    known = np.isfinite(stacked)
    total = np.where(known, stacked, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True, slots=True)
class Nearness:
    """How being near counts: with `weight` in [0, 1], added, or as a share of the score (`product`)."""

    weight: float
    product: bool = False

    def joined(self, score: Floats, spatial: Floats) -> Floats:
        """Scores with the spatial similarity of the same nodes (paper, phase 2); as they are where that is NaN."""
        return blend(score, score * spatial if self.product else spatial, self.weight)


def blend(score: Floats, other: Floats, weight: float) -> Floats:
    """(1 - weight) × score + weight × other; `score` itself where `other` is NaN."""
    return np.where(np.isnan(other), score, (1 - weight) * score + weight * other)
