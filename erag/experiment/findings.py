"""Who wins, with what confidence, and in what order the paper had it: sentences and tables, all of them computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from erag.evaluate.statistics import Comparison, holm
from erag.experiment.config import ColumnConfig, TableConfig
from erag.experiment.markdown import Sheet
from erag.experiment.scoring import Scored
from erag.experiment.sheets import slug
from erag.experiment.tables import OPEN, Choices, Table, Values, columns_of, paired, sign

SURE = 0.05  # the p-value after Holm's correction below which a difference is called one
UNSURE = "no difference shown"
CONTROLS = frozenset({"ss_generic", "ss_echo", "fact_coverage_generic"})  # the same for every system
LEAST = 20  # questions in common below which a system is not the best other one, unless the default has no more


@dataclass(frozen=True)
class Finding:
    """A column: our default against the best of the systems that are not ours, on the questions both were asked."""

    column: ColumnConfig
    ours: float
    other: float
    test: Comparison

    @property
    def verdict(self) -> str:
        """Which of the two is better, or that no difference is shown."""
        if self.test.adjusted >= SURE or not self.test.difference.mean:
            return UNSURE
        gain = self.test.difference.mean * sign(self.column)
        return f"{self.test.system if gain > 0 else self.test.baseline} is better"

    @property
    def n(self) -> int:
        return self.test.wins + self.test.ties + self.test.losses


def findings(config: TableConfig, data: str, scores: Sequence[Scored], choices: Choices) -> list[Finding]:
    """A finding a column in which our default and another system were asked; Holm's correction over the columns."""
    if not choices.ours:
        return []
    made = []
    for column, values in zip(config.columns, columns_of(config, data, scores, choices), strict=True):
        best = None if column.metric in OPEN | CONTROLS else _best_other(column, values, choices)
        if best is not None:
            made.append((column, best, values))
    tests = [paired(choices.ours[0], best, values, choices) for _, best, values in made]
    adjusted = holm({str(i): test.p for i, test in enumerate(tests)})
    return [
        _finding(column, best, values, replace(test, adjusted=adjusted[str(i)]))
        for i, ((column, best, values), test) in enumerate(zip(made, tests, strict=True))
    ]


def _best_other(column: ColumnConfig, values: Mapping[str, Values], choices: Choices) -> str | None:
    """The system that is not ours with the best mean, of those that were asked enough of what our default was."""
    default = values.get(choices.ours[0], {})
    least = min(LEAST, len(default))
    others = {n: [v[k] for k in v if k in default] for n, v in values.items() if n not in choices.ours}
    means = {n: sum(known) / len(known) for n, known in others.items() if known and len(known) >= least}
    return max(means, key=lambda name: sign(column) * means[name]) if means else None


def _finding(column: ColumnConfig, best: str, values: Mapping[str, Values], test: Comparison) -> Finding:
    ours, other = values[test.system], values[best]
    shared = [key for key in ours if key in other]
    return Finding(
        column, sum(ours[k] for k in shared) / len(shared), sum(other[k] for k in shared) / len(shared), test
    )


def told(found: Sequence[Finding], data: str) -> list[str]:
    """The findings of a table in words: where our default is better, where worse, where nothing is shown."""
    if not found:
        return []
    default = found[0].test.system
    better = [f for f in found if f.verdict == f"{default} is better"]
    worse = [f for f in found if f not in better and f.verdict != UNSURE]
    unsure = [f for f in found if f.verdict == UNSURE]
    counts = f"better in {len(better)} of {len(found)} columns, worse in {len(worse)}"
    lines = [f"On {data}: `{default}` is, against the best system that is not ours, {counts}.", ""]
    lines += [f"* **{what}**: {_sentence(f)}." for what, some in (("better", better), ("worse", worse)) for f in some]
    if unsure:
        lines.append(f"* no difference shown: {'; '.join(map(_sentence, unsure))}.")
    return [*lines, ""]


def _sentence(one: Finding) -> str:
    test, by = one.test, one.test.difference
    return (
        f"{one.column.title} {one.ours:.2f} to the {one.other:.2f} of {test.baseline} ({by.mean:+.2f} "
        f"[{by.low:+.2f}, {by.high:+.2f}], n {one.n}, p {_p(test.adjusted)})"
    )


def _p(value: float) -> str:
    return "< .001" if value < 0.001 else f"= {value:.3f}".replace("0.", ".")


def told_of_parts(made: Table, against: str) -> list[str]:
    """The tests of a table against one system in words, a line a column: who is better, who worse, the others."""
    lines = [
        f"* **{column.title}** ({_value(made, against, column)}): {_changes(made.tests[column.title], column)}."
        for column in made.columns
        if column.title in made.tests
    ]
    return [f"On {made.data}, {made.title}, against `{against}`:", "", *lines, ""] if lines else []


def _changes(tests: Sequence[Comparison], column: ColumnConfig) -> str:
    sure = [t for t in tests if t.adjusted < SURE and t.difference.mean]
    better = [t for t in sure if t.difference.mean * sign(column) > 0]
    parts = {"better": better, "worse": [t for t in sure if t not in better]}
    said = [f"{what}: {', '.join(map(_change, some))}" for what, some in parts.items() if some]
    others = len(tests) - len(sure)
    if others:
        said.append(f"no difference shown for {'the other' if sure else 'any of'} {others}")
    return "; ".join(said)


def _change(test: Comparison) -> str:
    return f"{test.system} {test.difference.mean:+.2f} (p {_p(test.adjusted)})"


def _value(made: Table, name: str, column: ColumnConfig) -> str:
    cell = made.rows[name][made.columns.index(column)] if name in made.rows else None
    return "–" if cell is None else str(cell)


def findings_sheet(found: Sequence[Finding], title: str, data: str) -> list[Sheet]:
    """The findings as a table; none where there are none."""
    rows = [
        (f.column.title, str(f.n), f.test.system, f"{f.ours:.3f}", f.test.baseline, f"{f.other:.3f}",
         f"{f.test.difference.mean:+.3f} [{f.test.difference.low:+.3f}, {f.test.difference.high:+.3f}]",
         f"{f.test.p:.4f}", f"{f.test.adjusted:.4f}", f"{f.test.wins} / {f.test.ties} / {f.test.losses}", f.verdict)
        for f in found
    ]  # fmt: skip
    if not rows:
        return []
    columns = (
        "column", "n", "our default", "mean", "best other", "mean", "difference", "p", "Holm", "wins / ties / losses",
        "verdict",
    )  # fmt: skip
    notes = (
        "Paired permutation tests on the questions both were asked. The best other system is the one with the best "
        "mean on them, which favours it; Holm's correction over the columns of the table.",
    )
    return [Sheet(slug(title, data, "findings"), f"Who wins, {title}: {data}", columns, tuple(rows), notes)]


def order_sheet(made: Table, choices: Choices) -> list[Sheet]:
    """For each column with figures of the paper, its order of the systems and ours; none where it printed nothing."""
    rows = []
    for i, column in enumerate(made.columns):
        here = {n: cells[i] for n, cells in made.rows.items() if n in choices.counterparts or n in choices.ours[:1]}
        known = {_named(n, choices): cell.value for n, cell in here.items() if cell is not None}
        if column.printed and known:
            rows.append((column.title, _order(column.printed), _order(known)))
    if not rows:
        return []
    notes = ("The paper's figures are of its own data, models and judges: what can be compared is the order.",)
    columns = ("column", "the paper", "here")
    title = f"The order of the systems, {made.title}: {made.data}"
    return [Sheet(slug(made.title, made.data, "order"), title, columns, tuple(rows), notes)]


def _named(name: str, choices: Choices) -> str:
    stands = choices.counterparts.get(name)
    return name if stands is None or stands in name else f"{name} (for {stands})"


def _order(values: Mapping[str, float]) -> str:
    ordered = sorted(values.items(), key=lambda item: -item[1])
    return " > ".join(f"{name} {value:.2f}" for name, value in ordered)
