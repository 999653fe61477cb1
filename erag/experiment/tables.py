"""Tables of an experiment: means with intervals and n, and paired tests against the best flat baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from erag.evaluate.statistics import (
    Comparison,
    Interval,
    bootstrap,
    clustered_bootstrap,
    holm,
    paired_bootstrap,
    permutation_test,
)
from erag.experiment.config import ColumnConfig, TableConfig
from erag.experiment.predictions import QuestionKey
from erag.experiment.scoring import Scored

OPEN = frozenset({"metres@1", "on_edges@1", "on_edges@5", "reading@1"})  # metrics that need an answer
LOWER = ("seconds", "visited", "metres", "tokens", "calls", "refused", "error")  # less is better


@dataclass(frozen=True)
class Cell:
    """A mean over n questions with its interval; the paper's printed figures have neither."""

    value: float
    interval: Interval | None = None
    n: int | None = None

    def __str__(self) -> str:
        if self.interval is None:
            return f"{self.value:.3g}"
        return f"{_short(self.value)} [{_short(self.interval.low)}, {_short(self.interval.high)}]"


@dataclass(frozen=True)
class Table:
    """A table of one data set: cells by row and column (None: not asked), and the tests of its columns."""

    title: str
    data: str
    columns: tuple[ColumnConfig, ...]
    rows: Mapping[str, tuple[Cell | None, ...]]
    tests: Mapping[str, tuple[Comparison, ...]]


@dataclass(frozen=True)
class Choices:
    """How tables are made: systems in the order of rows, which of them are flat, and over what intervals are taken."""

    systems: Sequence[str]
    flat: frozenset[str]
    by_environment: bool = False
    seed: int = 0


Values = dict[QuestionKey, float]


def table(config: TableConfig, data: str, scores: Sequence[Scored], choices: Choices) -> Table:
    """The table of a data set: the paper's rows first, then the systems; a column's tests where it has two systems."""
    names = [n for n in choices.systems if not config.systems or n in config.systems]
    inside = [s for s in scores if s.prediction.data == data and s.prediction.system in names]
    found = [_column(column, inside) for column in config.columns]
    rows: dict[str, tuple[Cell | None, ...]] = {}
    for name in dict.fromkeys(n for column in config.columns for n in column.printed):
        cells = (Cell(c.printed[name]) if name in c.printed else None for c in config.columns)
        rows[f"{name} (paper)"] = tuple(cells)
    for name in names:
        cells_of = tuple(_cell(column.get(name, {}), choices) for column in found)
        if any(cells_of):
            rows[name] = cells_of
    tests = {c.title: compared(values, c.metric, choices) for c, values in zip(config.columns, found, strict=True)}
    return Table(config.title, data, config.columns, rows, {title: made for title, made in tests.items() if made})


def _column(column: ColumnConfig, scores: Sequence[Scored]) -> dict[str, Values]:
    """The values of a column by system and question."""
    found: dict[str, Values] = {}
    for one in scores:
        fits = one.prediction.mode == column.mode and column.set in one.question.sets
        if fits and (one.question.stated or not column.stated) and column.metric in one.values:
            found.setdefault(one.prediction.system, {})[one.prediction.question] = one.values[column.metric]
    return found


def _cell(values: Values, choices: Choices) -> Cell | None:
    if not values:
        return None
    known = list(values.values())
    interval = (
        clustered_bootstrap(known, [_place(key) for key in values], seed=choices.seed)
        if choices.by_environment
        else bootstrap(known, seed=choices.seed)
    )
    return Cell(interval.mean, interval, len(known))


def compared(column: Mapping[str, Values], metric: str, choices: Choices) -> tuple[Comparison, ...]:
    """Every system against the best flat baseline of the column, on the questions both were asked; Holm over all.

    The best is the one with the best mean on the questions it was asked, which favours the baselines. A metric that
    needs an answer is not compared: its questions are not the same.
    """
    flat = [name for name in column if name in choices.flat and column[name]]
    if not flat or metric in OPEN:
        return ()
    sign = -1.0 if metric.startswith(LOWER) else 1.0
    best = max(flat, key=lambda name: sign * sum(column[name].values()) / len(column[name]))
    shared = {n: [k for k in column[n] if k in column[best]] for n in choices.systems if n in column and n != best}
    paired = {n: ([column[n][k] for k in keys], [column[best][k] for k in keys]) for n, keys in shared.items() if keys}
    groups = {n: [_place(k) for k in keys] if choices.by_environment else None for n, keys in shared.items()}
    p = {n: permutation_test(a, b, groups[n], seed=choices.seed) for n, (a, b) in paired.items()}
    adjusted = holm(p)
    return tuple(_comparison(n, best, *paired[n], groups[n], p[n], adjusted[n], choices.seed) for n in paired)


def _comparison(
    name: str,
    best: str,
    system: Sequence[float],
    baseline: Sequence[float],
    groups: Sequence[str] | None,
    p: float,
    adjusted: float,
    seed: int,
) -> Comparison:
    wins = sum(a > b for a, b in zip(system, baseline, strict=True))
    losses = sum(a < b for a, b in zip(system, baseline, strict=True))
    interval = paired_bootstrap(system, baseline, groups, seed=seed)
    return Comparison(name, best, interval, p, adjusted, wins, len(system) - wins - losses, losses)


def _place(key: QuestionKey) -> str:
    return f"{key[0]} {key[1]}"


def _short(value: float) -> str:
    """Two decimals below 10, else as many digits as a table has room for."""
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}"
