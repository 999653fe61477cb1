"""Visits: runs of observations with no long gap in time between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.times import plain_date
from erag.core.types import IntArray, TopoMap

LEAST_GAP_S = 1800.0  # no shorter pause makes a new visit
STEPS = 30.0  # nor one of fewer times the usual step between observations


@dataclass(frozen=True, eq=False)
class Visit:
    """The nodes `rows` (r,) seen between `start` and `end` (UTC seconds, end inclusive); `number` counts from 1."""

    number: int
    start: float
    end: float
    rows: IntArray


def visits(topomap: TopoMap, gap: float | None = None) -> tuple[Visit, ...]:
    """The visits of a map, the earliest first; nodes of unknown time, or known to a day at best, belong to none.

    `gap` is the pause in seconds that separates two; by default 30 times the median step between observations, at least
    half an hour.
    """
    timed = [(i, n.time.start) for i, n in enumerate(topomap.nodes) if n.time and n.time.end - n.time.start < 86_400]
    if not timed:
        return ()
    rows = np.array([i for i, _ in timed], np.int64)
    starts = np.array([start for _, start in timed], np.float64)
    order = np.lexsort((rows, starts))
    rows, starts = rows[order], starts[order]
    steps = np.diff(starts)
    moving = steps[steps > 0]
    pause = gap if gap is not None else max(LEAST_GAP_S, STEPS * float(np.median(moving)) if len(moving) else 0.0)
    ends = [*np.flatnonzero(steps > pause).tolist(), len(rows) - 1]
    begins = [0, *(end + 1 for end in ends[:-1])]
    return tuple(
        Visit(k, float(starts[a]), float(starts[b]), np.sort(rows[a : b + 1]))
        for k, (a, b) in enumerate(zip(begins, ends, strict=True), 1)
    )


def newest(topomap: TopoMap) -> float | None:
    """The moment of the newest observation in UTC seconds; None where no node has a time."""
    return max((node.time.start for node in topomap.nodes if node.time), default=None)


def ordinal(visits_: Sequence[Visit], number: int) -> str:
    """How a visit is called: `the first visit (2025-04-12)`."""
    names = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
    name = names[number - 1] if number <= len(names) else f"{number}th"
    return f"the {name} visit ({plain_date(visits_[number - 1].start)})"
