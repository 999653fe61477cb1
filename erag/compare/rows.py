"""The rows of a comparison: what was measured of each backend or system, as a table of values; what to deploy."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TextIO

from erag.compare.cells import Cell
from erag.compare.config import Role
from erag.compare.trial import Judgement
from erag.evaluate.statistics import Interval

GIB_MB = 1073.741824  # MB
Kind = Literal["local", "cloud", "truth", "control", "none"]


@dataclass(frozen=True)
class Row:
    """A line of the table.

    A `local` backend or system was measured (`cell`), as was a system over what the `cloud` or the `truth` says, which
    nobody can deploy; the cloud's records and a `control` need no model; `none` is a trial that cannot be made. Seconds
    and tokens are told of `units`. Without a judgement, `note` says why.
    """

    trial: str
    role: Role
    backend: str
    kind: Kind
    measure: str
    against: str
    items: int
    judgement: Judgement | None
    units: int = 0
    cell: Cell | None = None
    note: str = ""

    @property
    def seconds(self) -> float | None:
        """Seconds a unit."""
        return None if self.cell is None or not self.units else self.cell.seconds / self.units

    @property
    def tokens(self) -> float | None:
        """Tokens read and written a unit; None for a model that counts none."""
        counted = 0 if self.cell is None else self.cell.tokens_in + self.cell.tokens_out
        return counted / self.units if counted and self.units else None

    @property
    def peak_mb(self) -> float | None:
        return None if self.cell is None else self.cell.peak_mb

    @property
    def file_mb(self) -> float | None:
        return None if self.cell is None else self.cell.file_mb


@dataclass(frozen=True, slots=True)
class Verdict:
    """What to deploy in `gib` of memory for a trial: `row`, chosen among `fitting` rows; None where none fits."""

    trial: str
    gib: float
    row: Row | None
    best: Row | None
    fitting: int


def verdict(rows: Sequence[Row], trial: str, gib: float) -> Verdict:
    """The fastest backend whose loss cannot be told from the least loss of those that fit.

    A backend fits when the largest resident size of its whole process is within `gib`. It cannot be told from the best
    when its loss is not above the upper end of the best one's 95 % interval.
    """
    own = [r for r in rows if r.trial == trial and r.kind == "local" and r.judgement is not None]
    fitting = [r for r in own if r.peak_mb is not None and r.peak_mb <= gib * GIB_MB]
    if not fitting:
        return Verdict(trial, gib, None, None, 0)
    best = min(fitting, key=lambda r: (_loss(r), r.backend))
    limit = max(_loss(best), best.judgement.loss.high) if best.judgement is not None else 0.0
    near = [r for r in fitting if _loss(r) <= limit]
    return Verdict(trial, gib, min(near, key=lambda r: (r.seconds or 0.0, r.backend)), best, len(fitting))


def pareto(rows: Sequence[Row]) -> list[Row]:
    """The local rows that no other beats in seconds a unit and in loss, the fastest first."""
    known = [r for r in rows if r.kind == "local" and r.seconds is not None and r.judgement is not None]
    front: list[Row] = []
    for row in sorted(known, key=lambda r: (r.seconds or 0.0, _loss(r))):
        if not front or _loss(row) < _loss(front[-1]):
            front.append(row)
    return front


def write_csv(rows: Sequence[Row], file: TextIO) -> None:
    """All rows with all values, a header first."""
    table = csv.writer(file, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows(_values(row) for row in rows)


def _loss(row: Row) -> float:
    return float("inf") if row.judgement is None else row.judgement.loss.mean


_COLUMNS = (
    "trial", "role", "backend", "kind", "items", "measure", "value", "low", "high", "against", "loss", "loss_low",
    "loss_high", "seconds_a_unit", "load_seconds", "build_seconds", "tokens_a_unit", "base_mb", "peak_mb", "file_mb",
    "cost", "more", "note",
)  # fmt: skip


def _values(row: Row) -> list[object]:
    found, cell = row.judgement, row.cell
    figures = (None,) * 7 if found is None else (*_three(found.figure), row.against, *_three(found.loss))
    more = "" if found is None else "; ".join(f"{name} {each}" for name, each in found.more.items())
    took = (None,) * 4 if cell is None else (cell.load_seconds, cell.build_seconds, cell.base_mb, cell.cost)
    values = (
        row.trial, row.role, row.backend, row.kind, row.items, row.measure, *figures, row.seconds, *took[:2],
        row.tokens, took[2], row.peak_mb, row.file_mb, took[3], more, row.note,
    )  # fmt: skip
    return [f"{v:.5g}" if isinstance(v, float) else "" if v is None else v for v in values]


def _three(interval: Interval) -> tuple[float, float, float]:
    return interval.mean, interval.low, interval.high
