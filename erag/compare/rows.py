"""The rows of a comparison: what was measured of each backend, as a table of values, and what to deploy."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TextIO

from erag.compare.cells import Cell
from erag.compare.trial import Judgement
from erag.lm.roles import RoleName

GIB_MB = 1073.741824  # MB


@dataclass(frozen=True)
class Row:
    """A line of the table: a backend (`local`), the cloud's records (`cloud`) or what needs no model (`control`).

    `cell` and `file_mb` are those of a measured backend; `units` (None: the items) are what seconds and tokens are told
    of. Without a judgement, `note` says why.
    """

    trial: str
    role: RoleName
    backend: str
    kind: str
    measure: str
    against: str
    items: int
    judgement: Judgement | None
    cell: Cell | None = None
    file_mb: float | None = None
    note: str = ""
    units: int | None = None

    @property
    def seconds(self) -> float | None:
        """Seconds an item, or a unit."""
        units = self.units or self.items
        return None if self.cell is None or not units else self.cell.seconds / units

    @property
    def tokens(self) -> float | None:
        """Tokens read and written an item, or a unit; None for a model that counts none."""
        counted, units = (
            0 if self.cell is None else self.cell.tokens_in + self.cell.tokens_out,
            self.units or self.items,
        )
        return counted / units if counted and units else None

    @property
    def peak_mb(self) -> float | None:
        return None if self.cell is None else self.cell.peak_mb


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
    limit = best.judgement.loss.high if best.judgement is not None else 0.0
    near = [r for r in fitting if _loss(r) <= limit]
    return Verdict(trial, gib, min(near, key=lambda r: (r.seconds or 0.0, r.backend)), best, len(fitting))


def pareto(rows: Sequence[Row]) -> list[Row]:
    """The measured rows that no other beats in seconds an item and in loss, the fastest first."""
    known = [r for r in rows if r.seconds is not None and r.judgement is not None]
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
    return float("inf") if row.judgement is None else row.judgement.loss.value


_COLUMNS = (
    "trial", "role", "backend", "kind", "items", "measure", "value", "low", "high", "against", "loss", "loss_low",
    "loss_high", "seconds_an_item", "load_seconds", "tokens_an_item", "base_mb", "peak_mb", "file_mb", "cost",
    "more", "note",
)  # fmt: skip


def _values(row: Row) -> list[object]:
    found, cell = row.judgement, row.cell
    figures = ("",) * 3 if found is None else (found.figure.value, found.figure.low, found.figure.high)
    losses = ("",) * 3 if found is None else (found.loss.value, found.loss.low, found.loss.high)
    more = "" if found is None else "; ".join(f"{f.name} {f.short}" for f in found.more)
    loads = ("", "") if cell is None else (cell.load_seconds, cell.base_mb)
    values = (
        row.trial, row.role, row.backend, row.kind, row.items, row.measure, *figures, row.against, *losses,
        row.seconds, loads[0], row.tokens, loads[1], row.peak_mb, row.file_mb,
        "" if cell is None else cell.cost, more, row.note,
    )  # fmt: skip
    return [f"{v:.5g}" if isinstance(v, float) else "" if v is None else v for v in values]
