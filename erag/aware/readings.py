"""The readings of a sensor over a set of nodes: mean, spread, trend over time, where they are highest and lowest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.times import plain_date
from erag.core.types import IntArray, TopoMap

Floats = npt.NDArray[np.float64]
DAY_S = 86_400.0
_CLEAR = 2.0  # standard errors from which on a change counts as a trend


@dataclass(frozen=True, slots=True)
class Trend:
    """Mean readings of the first and the last visit (or half of the time), and when those were; `clear`: no chance."""

    first: float
    last: float
    since: float
    until: float
    clear: bool


@dataclass(frozen=True, slots=True)
class Readings:
    """A channel over `of` nodes, `read` of which have a reading: mean, spread (standard deviation), 10 % and 90 %."""

    channel: str
    of: int
    read: int
    mean: float
    spread: float
    low: float
    high: float
    trend: Trend | None = None

    def line(self) -> str:
        """In a line: `ndvi 0.31 (0.12 to 0.55), falling from 0.41 (2025-04-12) to 0.22 (2025-10-25)`."""
        said = f"{self.channel} {self.mean:.2f} ({self.low:.2f} to {self.high:.2f})"
        return f"{said}, {trend_words(self.trend)}" if self.trend else said


def trend_words(trend: Trend) -> str:
    """A trend in words and numbers."""
    way = ("rising" if trend.last > trend.first else "falling") if trend.clear else "about steady"
    return f"{way} from {trend.first:.2f} ({plain_date(trend.since)}) to {trend.last:.2f} ({plain_date(trend.until)})"


def readings(topomap: TopoMap, rows: IntArray, channel: str, visits: Sequence[IntArray] = ()) -> Readings | None:
    """The readings of a channel at nodes `rows` (r,); None where there are none.

    The trend compares the first of `visits` (rows of each) that has readings with the last; it is clear where the means
    are two standard errors apart.
    """
    values, known = _values(topomap, rows, channel)
    if not len(values):
        return None
    low, high = np.quantile(values, (0.1, 0.9))
    spread = float(values.std())
    trend = _trend(topomap, known, channel, visits)
    return Readings(channel, len(rows), len(values), float(values.mean()), spread, float(low), float(high), trend)


def _values(topomap: TopoMap, rows: IntArray, channel: str) -> tuple[Floats, IntArray]:
    known = [int(r) for r in rows if np.isfinite(topomap.nodes[int(r)].sensors.get(channel, np.nan))]
    return np.array([topomap.nodes[r].sensors[channel] for r in known], np.float64), np.array(known, np.int64)


def _trend(topomap: TopoMap, rows: IntArray, channel: str, visits: Sequence[IntArray]) -> Trend | None:
    parts = [_values(topomap, np.intersect1d(rows, visit), channel) for visit in visits]
    parts = [part for part in parts if len(part[0]) > 1]
    if len(parts) < 2:
        return None
    (a, early), (b, late) = parts[0], parts[-1]
    error = float(np.sqrt(a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b)))
    clear = abs(float(b.mean() - a.mean())) > _CLEAR * error
    return Trend(float(a.mean()), float(b.mean()), _start(topomap, early), _start(topomap, late), clear)


def _start(topomap: TopoMap, rows: IntArray) -> float:
    return min(t.start for r in rows if (t := topomap.nodes[int(r)].time) is not None)


def extremes(topomap: TopoMap, parts: Sequence[tuple[str, IntArray]], channel: str) -> list[tuple[str, float]]:
    """Named parts of a map by their mean reading, highest first; parts without readings are left out."""
    means = [(name, values.mean()) for name, rows in parts if len(values := _values(topomap, rows, channel)[0])]
    return [(name, float(mean)) for name, mean in sorted(means, key=lambda part: (-part[1], part[0]))]


def standing(readings: Floats, value: float) -> float:
    """The share of known `readings` (n,) that lie below `value`, those equal to it counted half."""
    known = readings[np.isfinite(readings)]
    return float(((known < value).sum() + 0.5 * (known == value).sum()) / max(len(known), 1))
