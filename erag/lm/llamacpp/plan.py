"""What is computed, and in which pieces: beginnings that token paths share are computed once.

Plans depend on the paths alone, never on what was asked before. No piece is a single row where that can be helped:
llama.cpp multiplies one row by other kernels than several, and only several give a row the same bits in any company.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from erag.lm.llamacpp.native import Row

Path = tuple[int, ...]
LEAST = 2  # rows of a piece


def shared(a: Sequence[int], b: Sequence[int]) -> int:
    """How many tokens two paths begin with in common."""
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


@dataclass(frozen=True, slots=True)
class Step:
    """Part of a reading: keep the first `keep` tokens of what was read, then read `rows`."""

    keep: int
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Reading:
    """Paths read one after the other in one sequence; `at[i][n]` is the (step, row) of wanted position n of path i."""

    steps: tuple[Step, ...]
    at: tuple[tuple[tuple[int, int], ...], ...]


def reading(paths: Sequence[Path], wanted: Sequence[range]) -> Reading:
    """How to read paths (not empty, in sorted order); `wanted[i]` are the positions of path i that need logits."""
    steps: list[tuple[int, Path]] = []  # tokens kept, path read from there on
    places: list[list[tuple[int, int]]] = []  # of each path: (step, row) of each position
    for i, path in enumerate(paths):
        common = shared(paths[i - 1], path) if i else 0
        known = places[-1][:common] if i else []
        if common < len(path):
            keep = max(0, min(common, len(path) - LEAST))
            fresh = [(len(steps), p - keep) for p in range(common, len(path))]
            steps.append((keep, path))
            known = known + fresh
        places.append(known)
    at = tuple(tuple(place[p] for p in asked) for place, asked in zip(places, wanted, strict=True))
    needed = {place for places_of_path in at for place in places_of_path}
    rows = [
        tuple(Row(path[p], p, 0, (s, p - keep) in needed) for p in range(keep, len(path)))
        for s, (keep, path) in enumerate(steps)
    ]
    return Reading(tuple(Step(keep, r) for (keep, _), r in zip(steps, rows, strict=True)), at)


def pieces(rows: Sequence[Row], size: int, outputs: int) -> Iterator[Sequence[Row]]:
    """Rows in order, cut where a piece has `size` rows or `outputs` wanted ones (both at least 3); no lone last row."""
    cuts, wanted = [0], 0
    for i, row in enumerate(rows):
        if i - cuts[-1] == size or (row.wanted and wanted == outputs):
            cuts.append(i)
            wanted = 0
        wanted += row.wanted
    if len(cuts) > 1 and len(rows) - cuts[-1] < LEAST <= cuts[-1] - cuts[-2] - 1:
        cuts[-1] -= 1
    for start, end in zip(cuts, (*cuts[1:], len(rows)), strict=True):
        if start < end:
            yield rows[start:end]
