"""The whole comparison: everyone in every trial it is named for, judged; resumable cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import yaml

from erag.compare.cells import Cell, Job, measured
from erag.compare.config import CompareConfig, MemoriesTrial
from erag.compare.page import page
from erag.compare.rows import Kind, Row, write_csv
from erag.compare.trial import LABELS, Judgement, Outputs, Trial
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
        rows += _rows(config, name, store, judge, say)
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


def _rows(config: CompareConfig, name: str, store: ModelStore, judge: Embedder, say: Say) -> list[Row]:
    """The rows of one trial; one that cannot be made is one row that says why."""
    trial = trial_of(config, name, store)
    try:
        items = list(trial.items)
    except EragError as error:
        say(f"{name}: not measured: {error.line()}")
        return [Row(name, trial.role, "–", "none", trial.measure, trial.against, 0, None, note=error.line())]
    return list(_Asking(config, name, store, judge, say, trial, items).rows())


@dataclass(frozen=True)
class _Asking:
    """One trial, everyone of which is asked and judged."""

    config: CompareConfig
    name: str
    store: ModelStore
    judge: Embedder
    say: Say
    trial: Trial
    items: list[object]

    def rows(self) -> Iterator[Row]:
        spoken = self.trial.cloud()
        if spoken is not None:
            yield self._row(f"{self.trial.against} (recorded)", "cloud", spoken)
        elif self.trial.against == LABELS:
            yield self._row("cloud", "cloud", None, note="no record exists: against labels")
        chosen = self.config.trials[self.name]
        if isinstance(chosen, MemoriesTrial):
            yield from self._systems(chosen)
        else:
            yield from (self._measured(backend, "local") for backend in chosen.backends)
        for title, outputs in self.trial.controls().items():
            yield self._row(title, "control", outputs)

    def _systems(self, chosen: MemoriesTrial) -> Iterator[Row]:
        """The reference first; with what a cloud model said in its memory, the others are held against it."""
        best: Judgement | None = None
        if chosen.reference is not None:
            reference = self._measured(chosen.reference, "cloud" if chosen.cloud else "truth")
            best = reference.judgement if chosen.cloud else None
            yield _against(reference, best)
        for system in chosen.systems:
            yield _against(self._measured(system, "local"), best)

    def _measured(self, backend: str, kind: Kind) -> Row:
        job = Job(self.name, backend, self.config, self.items, self.store.files)
        cell, kept = measured(job, self.config.out / "cells", self.store)
        built = f"{cell.build_seconds:.1f} s to build, " if cell.build_seconds else ""
        took = f"{built}{cell.load_seconds:.1f} s to load, {cell.seconds:.1f} s for {len(self.items)} items"
        self.say(f"{self.name}, {backend}: {cell.error or ('kept' if kept else took)}")
        if cell.error:
            return self._row(backend, kind, None, note=cell.error)
        return self._row(backend, kind, cell.outputs, cell, _told(cell))

    def _row(self, backend: str, kind: Kind, outputs: Outputs | None, cell: Cell | None = None, note: str = "") -> Row:
        trial = self.trial
        judged = None if outputs is None else trial.judge(outputs, self.judge)
        return Row(
            self.name, trial.role, backend, kind, trial.measure, trial.against, len(self.items), judged, trial.units,
            cell, note,
        )  # fmt: skip


def _against(row: Row, best: Judgement | None) -> Row:
    if best is None or row.judgement is None:
        return row
    return replace(row, judgement=row.judgement.against(best))


def _told(cell: Cell) -> str:
    """What should be known of a cell: how long its memories took, what was not answered, what was counted."""
    built = [f"memories built in {cell.build_seconds:.0f} s"] if cell.build_seconds else []
    failed = sum(output is None for output in cell.outputs)
    events = [f"{failed:,} items not answered"] if failed else []
    return "; ".join([*built, *events, *(f"{n:,} {event}" for event, n in sorted(cell.events.items()))])
