"""Scores as sheets: the tables of the paper's form, their tests, and the panel's agreement with labels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from erag.experiment.agreement import AgreementRow
from erag.experiment.markdown import Sheet
from erag.experiment.tables import Cell, Table

NONE = "–"


def slug(*parts: str) -> str:
    """A file name of words."""
    return re.sub(r"[^a-z0-9]+", "-", " ".join(parts).lower()).strip("-")[:80]


def table_sheet(made: Table) -> Sheet:
    """A row a system; n where all its cells have the same, else in each cell."""
    rows = []
    for name, cells in made.rows.items():
        counts = {c.n for c in cells if c is not None and c.n is not None}
        one = str(next(iter(counts))) if len(counts) == 1 else NONE if not counts else "see cells"
        rows.append((name, one, *(_cell(c, len(counts) > 1) for c in cells)))
    notes = ("Mean with its 95 % interval; n is the number of questions.",)
    columns = ("system", "n", *(c.title for c in made.columns))
    return Sheet(slug(made.title, made.data), f"{made.title}: {made.data}", columns, tuple(rows), notes)


def _cell(cell: Cell | None, count: bool) -> str:
    if cell is None:
        return NONE
    return f"{cell} (n {cell.n})" if count and cell.n is not None else str(cell)


def tests_sheet(made: Table) -> list[Sheet]:
    """The paired tests of a table's columns; none where there are none."""
    rows = [
        (title, one.system, one.baseline, f"{one.difference.mean:+.3f}",
         f"[{one.difference.low:+.3f}, {one.difference.high:+.3f}]", f"{one.p:.4f}", f"{one.adjusted:.4f}",
         f"{one.wins} / {one.ties} / {one.losses}")
        for title, tests in made.tests.items()
        for one in tests
    ]  # fmt: skip
    if not rows:
        return []
    columns = ("column", "system", "against", "difference", "95 %", "p", "Holm", "wins / ties / losses")
    notes = (
        "Paired permutation tests on the questions both were asked, against the flat baseline with the best mean of "
        "the column, or the system the table is about; Holm's correction over the systems of a column.",
    )
    return [
        Sheet(slug(made.title, made.data, "tests"), f"Tests, {made.title}: {made.data}", columns, tuple(rows), notes)
    ]


def agreement_sheet(rows: Sequence[AgreementRow], facts: Mapping[str, Any]) -> list[Sheet]:
    """AUC and calibration of each judge and the panel; a judge whose model the systems use is marked."""
    if not rows:
        return []
    used = set(facts.get("retrieving", ()))
    table = [
        (row.data, row.kind, row.over, row.judge + (" *" if used & set(row.models) else ""), f"{row.pairs:,}",
         f"{row.positives:,}", f"{row.abstained:,}", _number(row.auc), _by_query(row), f"{row.brier:.3f}",
         f"{row.ece:.3f}")
        for row in rows
    ]  # fmt: skip
    columns = ("data", "kind", "over", "judge", "pairs", "right", "abstained", "AUC", "AUC by query", "Brier", "ECE")
    notes = (
        "Over the pairs that the systems `answered`, which is where a panel counts; and where it was tried beforehand, "
        "over the head of a ranking and over `all` of these and nodes drawn beside it. `*`: a model that systems of "
        "this run use, too.",
    )
    return [Sheet("agreement", "The panel against labels", columns, tuple(table), notes)]


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.3f}"


def _by_query(row: AgreementRow) -> str:
    if row.query_auc is None or row.query_low is None or row.query_high is None:
        return NONE
    return f"{row.query_auc:.2f} [{row.query_low:.2f}, {row.query_high:.2f}]"
