"""Tables of an experiment: means with intervals and n, and paired tests against the best flat baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

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
LOWER = ("seconds", "visited", "metres", "tokens", "calls", "refused", "error", "fact_contradicted")  # less is better


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
    """How tables are made: systems in the order of rows, and over what intervals are taken.

    `flat` are the flat baselines, `ours` the systems of this project with the default first, `counterparts` what
    systems stand for among those of the paper.
    """

    systems: Sequence[str]
    flat: frozenset[str]
    ours: Sequence[str] = ()
    counterparts: Mapping[str, str] = field(default_factory=dict)
    by_environment: bool = False
    seed: int = 0


Values = dict[QuestionKey, float]


def sign(column: ColumnConfig) -> float:
    """1 for a column of which more is better, -1 for one of which less is."""
    less = column.metric.startswith(LOWER) if column.better is None else column.better == "less"
    return -1.0 if less else 1.0


def table(config: TableConfig, data: str, scores: Sequence[Scored], choices: Choices) -> Table:
    """The table of a data set: the paper's rows first, then the systems; a column's tests where it has two systems."""
    names = [n for n in choices.systems if not config.systems or n in config.systems]
    found = columns_of(config, data, scores, choices)
    rows: dict[str, tuple[Cell | None, ...]] = {}
    for name in dict.fromkeys(n for column in config.columns for n in column.printed):
        cells = (Cell(c.printed[name]) if name in c.printed else None for c in config.columns)
        rows[f"{name} (paper)"] = tuple(cells)
    for name in names:
        cells_of = tuple(_cell(column.get(name, {}), choices) for column in found)
        if any(cells_of):
            rows[name] = cells_of
    tests = {
        c.title: compared(values, c, choices, config.against) for c, values in zip(config.columns, found, strict=True)
    }
    return Table(config.title, data, config.columns, rows, {title: made for title, made in tests.items() if made})


def columns_of(config: TableConfig, data: str, scores: Sequence[Scored], choices: Choices) -> list[dict[str, Values]]:
    """For each column of a table its values on a data set, by system and question."""
    names = {n for n in choices.systems if not config.systems or n in config.systems}
    inside = [s for s in scores if s.prediction.data == data and s.prediction.system in names]
    return [_column(column, inside) for column in config.columns]


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


def compared(
    values: Mapping[str, Values], column: ColumnConfig, choices: Choices, against: str = ""
) -> tuple[Comparison, ...]:
    """Every system against one, or the column's best flat baseline, on the questions both were asked; Holm over all.

    The best is the one with the best mean on the questions it was asked, which favours the baselines. A metric that
    needs an answer is not compared: its questions are not the same.
    """
    flat = [n for n in values if (n == against if against else n in choices.flat) and values[n]]
    if not flat or column.metric in OPEN:
        return ()
    best = max(flat, key=lambda name: sign(column) * sum(values[name].values()) / len(values[name]))
    others = [n for n in choices.systems if n in values and n != best and any(k in values[best] for k in values[n])]
    tests = {name: paired(name, best, values, choices) for name in others}
    adjusted = holm({name: test.p for name, test in tests.items()})
    return tuple(replace(test, adjusted=adjusted[name]) for name, test in tests.items())


def paired(system: str, baseline: str, column: Mapping[str, Values], choices: Choices) -> Comparison:
    """One system against another on the questions both were asked (one at least), before any correction."""
    keys = [key for key in column[system] if key in column[baseline]]
    a, b = [column[system][k] for k in keys], [column[baseline][k] for k in keys]
    groups = [_place(k) for k in keys] if choices.by_environment else None
    p = permutation_test(a, b, groups, seed=choices.seed)
    wins, losses = (sum(x > y for x, y in zip(*pair, strict=True)) for pair in ((a, b), (b, a)))
    interval = paired_bootstrap(a, b, groups, seed=choices.seed)
    return Comparison(system, baseline, interval, p, p, wins, len(keys) - wins - losses, losses)


def _place(key: QuestionKey) -> str:
    return f"{key[0]} {key[1]}"


def _short(value: float) -> str:
    """Two decimals below 10, else as many digits as a table has room for."""
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}"
