"""The page of a comparison, in Markdown: what to deploy in how much memory, a table a trial, and further figures."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from erag.compare.config import CompareConfig
from erag.compare.rows import Row, Verdict, verdict
from erag.compare.trial import LABELS
from erag.lm.probe import cpu

_LIBRARIES = ("torch", "llama-cpp-python", "transformers")
_RULE = (
    "The rule: of the backends whose whole process stayed within the memory, those count whose loss is not above the "
    "upper end of the least loss's 95 % interval; the fastest of them is named. Memory is that of one role alone: "
    "roles that one model plays share it, roles of several models add up. A control needs no model: where the backend "
    "named for the most memory does not lose less than the best of them by its whole interval, that is said."
)
_DATA = (
    "Losses are against the cloud's recorded answers where there are any, else against labels (1 − figure): a table "
    "says which. Intervals are bootstrap intervals over items; for F1 over images. SS is the cosine of two texts by "
    "the embedder that judges (`judge` in config.yaml): an embedder from its own family is favoured. Decisions, "
    "summaries and captions of the cloud come from one building, one city and one lobby: they bound what can be said. "
    "☁ is what a cloud model said, ∘ a system that is given the truth, · a control that needs no model."
)


def page(config: CompareConfig, rows: Sequence[Row], plot: str | None) -> str:
    """The page as text."""
    parts = ["# Backends compared", "", _machine(config), "", _DATA, ""]
    parts += ["## What to deploy", "", _RULE, "", *_verdicts(config, rows), ""]
    if plot is not None:
        parts += ["## Loss and seconds", "", f"![Loss against seconds, a panel a trial]({plot})", ""]
    for trial in dict.fromkeys(row.trial for row in rows):
        parts += _section([row for row in rows if row.trial == trial])
    return "\n".join(parts)


COLUMNS = ("backend", "figure [95 %]", "loss [95 %]", "s", "tokens", "MB", "file")


def cells(row: Row) -> tuple[str, ...]:
    """A row for a table of `COLUMNS`: seconds and tokens an item, peak memory and file size in MB."""
    found = row.judgement
    figures = ("–", row.note[:80] or "–") if found is None else (str(found.figure), str(found.loss))
    mark = {"cloud": "☁ ", "truth": "∘ ", "control": "· "}.get(row.kind, "")
    return (
        f"{mark}{row.backend}", *figures, _short(row.seconds), _number(row.tokens), _number(row.peak_mb),
        _number(row.file_mb),
    )  # fmt: skip


def title(rows: Sequence[Row]) -> str:
    """What a trial measures, in one line."""
    first = rows[0]
    source = f"against {first.against}" if first.against != LABELS else "no cloud record: against labels"
    return f"{first.trial} ({played(first)}): {first.measure}, {first.items} items, {source}"


def played(row: Row) -> str:
    """What a trial is about: a role, or a whole system."""
    return "end to end" if row.role == "all" else row.role


def _section(rows: Sequence[Row]) -> list[str]:
    more = list(dict.fromkeys(name for r in rows if r.judgement for name in r.judgement.more))
    parts = [f"## {title(rows)}", "", *_table(COLUMNS, [cells(row) for row in rows]), ""]
    if more:
        parts += [*_table(("backend", *more), [_further(row, more) for row in rows if row.judgement]), ""]
    notes = [f"* {row.backend}: {row.note}" for row in rows if row.note and row.judgement]
    return [*parts, *notes, ""] if notes else parts


def _further(row: Row, names: Sequence[str]) -> tuple[str, ...]:
    known = row.judgement.more if row.judgement else {}
    return (row.backend, *(str(known.get(name, "–")) for name in names))


def _verdicts(config: CompareConfig, rows: Sequence[Row]) -> list[str]:
    trials = dict.fromkeys(row.trial for row in rows if row.kind == "local" and row.judgement)
    roles = {row.trial: played(row) for row in rows}
    head = ("role", "trial", *(f"{gib:g} GiB" for gib in config.budgets), "best control")
    table = [
        (roles[t], t, *(_said(verdict(rows, t, gib)) for gib in config.budgets), _control(rows, t, max(config.budgets)))
        for t in trials
    ]
    return _table(head, table) if table else ["Nothing was measured."]


def _control(rows: Sequence[Row], trial: str, gib: float) -> str:
    """The control that loses least, and whether the backend chosen for `gib` loses less, its interval included."""
    known = [
        (r.judgement.loss.mean, r.backend) for r in rows if (r.trial, r.kind) == (trial, "control") and r.judgement
    ]
    if not known:
        return "–"
    loss, name = min(known)
    chosen = verdict(rows, trial, gib).row
    beaten = chosen is not None and chosen.judgement is not None and chosen.judgement.loss.high < loss
    return f"{name}: {loss:.2f}, {'beaten' if beaten else 'NOT beaten'}"


def _said(found: Verdict) -> str:
    row, best = found.row, found.best
    if row is None or row.judgement is None:
        return "none fits"
    return row.backend if row is best or best is None else f"{row.backend} (as good as {best.backend}, faster)"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(str(cell).replace('|', '/') for cell in line)} |" for line in lines]


def _machine(config: CompareConfig) -> str:
    threads = f"{config.threads} threads" if config.threads else "as many threads as CPUs"
    found = [f"{name} {v}" for name in _LIBRARIES if (v := _version(name))]
    parts = (cpu().architecture, threads, f"Python {platform.python_version()}", *found)
    return f"{', '.join(parts)}. Seconds are those in the model, loading apart; they compare within one run."


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:,.0f}"


def _short(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}" if value < 10 else f"{value:,.0f}"
