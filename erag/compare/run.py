"""The whole comparison: every backend in every trial it is named for, judged; resumable cell by cell."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import yaml

from erag.compare.cells import Cell, Job, measured, model_mb
from erag.compare.choosing import Search
from erag.compare.config import ROLE_OF, CompareConfig
from erag.compare.page import page
from erag.compare.rows import Row, write_csv
from erag.compare.trial import Outputs, Trial
from erag.compare.trials import trial_of
from erag.core.errors import EragError
from erag.core.output import replacing
from erag.core.progress import Progress, quiet
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_models
from erag.lm.roles import Embedder, Roles
from erag.lm.weights import ModelStore

Say = Callable[[str], None]


def compare(config: CompareConfig, store: ModelStore, say: Say, progress: Progress = quiet) -> list[Row]:
    """Measure, judge and write `report.md`, `table.csv`, `pareto.png` and `config.yaml` into `config.out`."""
    config.out.mkdir(parents=True, exist_ok=True)
    with replacing(config.out / "config.yaml") as file:
        yaml.safe_dump(config.model_dump(mode="json"), file, sort_keys=False, allow_unicode=True)
    judge = _judge(config, store)
    rows: list[Row] = []
    for done, name in enumerate(config.trials):
        progress("trials", done, len(config.trials))
        rows += _trial(config, name, store, judge, say)
    progress("trials", len(config.trials), len(config.trials))
    write(config, rows)
    return rows


def write(config: CompareConfig, rows: Sequence[Row]) -> None:
    """The files of the results. The plot needs matplotlib, and is left out without it."""
    from erag.compare.plot import plotted

    with replacing(config.out / "table.csv") as file:
        write_csv(rows, file)
    drawn = plotted(rows, config.out / "pareto.png")
    with replacing(config.out / "report.md") as file:
        file.write(page(config, rows, "pareto.png" if drawn else None))


def _judge(config: CompareConfig, store: ModelStore) -> Embedder:
    models = build_models(BackendConfig(models={"judge": config.judge}, roles={}), store)
    return compose(models, Roles({"embed": "judge"}))


def _trial(config: CompareConfig, name: str, store: ModelStore, judge: Embedder, say: Say) -> list[Row]:
    """The rows of one trial; one that cannot be made is one row that says why."""
    role = ROLE_OF[config.trials[name].kind]
    trial = trial_of(config, name, store)
    try:
        items = list(trial.items)
    except EragError as error:
        say(f"{name}: not measured: {error.line()}")
        return [Row(name, role, "–", "none", trial.measure, trial.against, 0, None, note=error.line())]
    units = trial.texts if isinstance(trial, Search) else None
    blank = Row(name, role, "", "local", trial.measure, trial.against, len(items), None, units=units)
    rows = []
    spoken = trial.cloud()
    if spoken is not None:
        title = f"{trial.against} (recorded)"
        rows.append(_judged(dataclasses.replace(blank, backend=title, kind="cloud"), trial, spoken, judge))
    for backend in config.trials[name].backends:
        job = Job(name, backend, config, items, store.files)
        cell, kept = measured(job, config.out / "cells", store)
        took = "kept" if kept else f"{cell.load_seconds:.1f} s to load, {cell.seconds:.1f} s for {len(items)} items"
        say(f"{name}, {backend}: {cell.error or took}")
        row = dataclasses.replace(
            blank, backend=backend, cell=None if cell.error else cell, note=cell.error or _events(cell),
            file_mb=model_mb(config.backends[backend].model, store),
        )  # fmt: skip
        rows.append(row if cell.error else _judged(row, trial, cell.outputs, judge))
    for title, outputs in trial.controls().items():
        rows.append(_judged(dataclasses.replace(blank, backend=title, kind="control"), trial, outputs, judge))
    return rows


def _judged(row: Row, trial: Trial, outputs: Outputs, judge: Embedder) -> Row:
    return dataclasses.replace(row, judgement=trial.judge(outputs, judge))


def _events(cell: Cell) -> str:
    failed = sum(output is None for output in cell.outputs)
    events = [f"{failed:,} items not answered"] if failed else []
    return "; ".join([*events, *(f"{n:,} {event}" for event, n in sorted(cell.events.items()))])
