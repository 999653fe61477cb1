"""The report of a run: Markdown, CSV, JSON and pictures, computed from the files of its folder alone."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erag.core.output import replacing
from erag.experiment.agreement import AgreementRow, answered_rows
from erag.experiment.canvas import Picture
from erag.experiment.capabilities import capabilities
from erag.experiment.config import ExperimentConfig, TableConfig
from erag.experiment.costs import costs
from erag.experiment.driving import Driven
from erag.experiment.figures import draw
from erag.experiment.findings import findings, findings_sheet, order_sheet, told, told_of_parts
from erag.experiment.judging import TextScored, Voted
from erag.experiment.markdown import Sheet, heading, sheet_lines
from erag.experiment.predictions import Prediction, read_predictions, read_records
from erag.experiment.questions import QuestionRecord
from erag.experiment.scoring import Scored, mean_vote, scored, stacked
from erag.experiment.sensitivity import sensitivity
from erag.experiment.sheets import agreement_sheet, table_sheet, tests_sheet
from erag.experiment.tables import Choices, Table, table
from erag.pipeline.config import load_config
from erag.retrieve.config import Bm25Config, FusionConfig, NodeConfig, SentenceConfig

DETAILS = "Details"
FLAT = (NodeConfig, SentenceConfig, Bm25Config, FusionConfig)


@dataclass(frozen=True)
class Folder:
    """The files of a run. All but the lock are meant to be kept: every figure is computed from them."""

    path: Path

    @property
    def config(self) -> Path:
        return self.path / "config.yaml"

    @property
    def questions(self) -> Path:
        return self.path / "questions.jsonl"

    @property
    def predictions(self) -> Path:
        return self.path / "predictions.jsonl"

    @property
    def votes(self) -> Path:
        return self.path / "votes.jsonl"

    @property
    def texts(self) -> Path:
        return self.path / "texts.jsonl"

    @property
    def trips(self) -> Path:
        return self.path / "trips.jsonl"

    @property
    def agreement(self) -> Path:
        return self.path / "agreement.jsonl"

    @property
    def tried(self) -> Path:
        return self.path / "tried.jsonl"

    @property
    def stack(self) -> Path:
        return self.path / "stack.json"

    @property
    def facts(self) -> Path:
        return self.path / "run.json"

    @property
    def metrics(self) -> Path:
        return self.path / "metrics.json"

    @property
    def page(self) -> Path:
        return self.path / "README.md"


@dataclass(frozen=True)
class Material:
    """What lies in a run's folder."""

    predictions: Sequence[Prediction]
    questions: Sequence[QuestionRecord]
    votes: Sequence[Voted]
    texts: Sequence[TextScored]
    trips: Sequence[Driven]
    agreement: Sequence[AgreementRow]
    facts: dict[str, Any]

    @classmethod
    def of(cls, folder: Folder) -> Material:
        return cls(
            read_predictions(folder.predictions),
            read_records(folder.questions, QuestionRecord),
            read_records(folder.votes, Voted),
            read_records(folder.texts, TextScored),
            read_records(folder.trips, Driven),
            read_records(folder.agreement, AgreementRow),
            json.loads(folder.facts.read_text(encoding="utf-8")) if folder.facts.is_file() else {},
        )


def write_report(config: ExperimentConfig, folder: Folder) -> None:
    """Write the page, a CSV file a table, `metrics.json` and the pictures."""
    material = Material.of(folder)
    by = stacked if config.panel.probability == "stack" else mean_vote()
    scores = scored(material.predictions, material.questions, material.votes, material.texts, by, material.trips)
    choices = choices_of(config, scores)
    wanted = [(t, data, table(t, data, scores, choices)) for t in config.tables for data in _data(t, config)]
    wanted = [one for one in wanted if one[2].rows]
    tables = [made for _, _, made in wanted]
    found = [] if config.sweep else [(t, data, findings(t, data, scores, choices)) for t, data, _ in wanted]
    rows = [*material.agreement, *answered_rows(material.votes, material.questions, config.panel, config.similarity)]
    shown = [s for t in tables for s in (table_sheet(t), *order_sheet(t, choices))]
    shown += capabilities(scores, choices.systems) if config.capabilities else []
    shown += agreement_sheet(rows, material.facts)
    details = [s for t, data, one in found for s in findings_sheet(one, t.title, data)]
    details += [s for t in tables for s in tests_sheet(t)]
    details += sensitivity(config, material.predictions, material.questions, material.votes, material.facts)
    details += costs(scores, choices.systems)
    pictures = draw(config, tables, scores, rows, choices, folder.path) if config.pictures else []
    for old in folder.path.glob("*.csv"):
        old.unlink()
    for sheet in (*shown, *details):
        _write_csv(folder.path / f"{sheet.name}.csv", sheet)
    with replacing(folder.metrics) as file:
        json.dump(_metrics(tables), file, indent=1, ensure_ascii=False)
        file.write("\n")
    words = [line for t, data, one in found for line in told(one, f"{data}, {t.title}")]
    words += [line for t, _, made in wanted if t.against for line in told_of_parts(made, t.against)]
    with replacing(folder.page) as file:
        file.writelines(f"{line}\n" for line in _page(config, words, shown, pictures))
        file.writelines(f"{line}\n" for line in _details(config, details, material.facts))


def choices_of(config: ExperimentConfig, scores: Sequence[Scored]) -> Choices:
    """The order of rows, and which systems are flat: those that say so, else by the kind of their retriever."""
    asked = {s.prediction.system for s in scores}
    names = [n for n in config.systems if n in asked]
    flat = frozenset(n for n in names if config.systems[n].flat or (_by_kind(config, n)))
    ours = tuple(n for n in names if config.systems[n].ours)
    counterparts = {n: config.systems[n].stands_for for n in names if config.systems[n].stands_for}
    return Choices(names, flat, ours, counterparts, config.intervals == "environments", config.seed)


def _by_kind(config: ExperimentConfig, name: str) -> bool:
    system = config.systems[name]
    if system.naive is not None:
        return False
    retrieve = load_config(system.preset, overrides=system.overrides).retrieve
    return isinstance(retrieve.retriever, FLAT) and retrieve.expand is None and retrieve.rescore is None


def _data(config: TableConfig, experiment: ExperimentConfig) -> Iterable[str]:
    return config.data or tuple(experiment.data)


def _metrics(tables: Sequence[Table]) -> list[dict[str, Any]]:
    """Every cell and every test as numbers."""
    made: list[dict[str, Any]] = []
    for one in tables:
        for name, cells in one.rows.items():
            for column, cell in zip(one.columns, cells, strict=True):
                if cell is not None:
                    low, high = (None, None) if cell.interval is None else (cell.interval.low, cell.interval.high)
                    made.append({"table": one.title, "data": one.data, "system": name, "column": column.title,
                                 "mean": cell.value, "low": low, "high": high, "n": cell.n})  # fmt: skip
    return made


def _page(
    config: ExperimentConfig,
    words: Sequence[str],
    sheets: Sequence[Sheet],
    pictures: Sequence[Picture],
) -> list[str]:
    """What the joined page shows, too: what the run says, its tables each with its pictures."""
    lines = [f"# {config.title}", ""]
    lines += [f"* {note}" for note in config.notes] + ([""] if config.notes else [])
    lines += [*heading("Who wins"), *words] if words else []
    for sheet in sheets:
        lines += sheet_lines(sheet)
        lines += [line for p in pictures if p.sheet == sheet.name for line in (f"![{p.told}]({p.file})", "")]
    systems = {name: system.note for name, system in config.systems.items() if system.note}
    if systems:
        lines += [*heading("Systems"), *(f"* **{name}**: {note}" for name, note in systems.items()), ""]
    return lines


def _details(config: ExperimentConfig, sheets: Sequence[Sheet], facts: dict[str, Any]) -> list[str]:
    """What a reader looks up on the run's own page: tests, other judges, costs, machine."""
    return [*heading(DETAILS), *(line for s in sheets for line in sheet_lines(s, 3)),
            *heading("Made with", 3), *_made_with(config, facts)]  # fmt: skip


def _made_with(config: ExperimentConfig, facts: dict[str, Any]) -> list[str]:
    if not facts:
        return ["Nothing is known of the machine: there is no `run.json`."]
    packages = ", ".join(f"{name} {number}" for name, number in facts["packages"].items())
    data = (f"{name} ({one['data']}): {one['nodes']:,} nodes, {one['questions']} questions, R {one['radius_m']:g} m"
            for name, one in facts["data"].items())  # fmt: skip
    return [
        f"* revision `{facts['revision']}`, seed {config.seed}, Python {facts['python']}, {packages}",
        f"* {facts['cpu']}, {facts['cores']} cores, {facts['memory_gb']} GB",
        *(f"* `{name}`: {digest}" for name, digest in facts["models"].items()),
        *(f"* {line}" for line in data),
        "",
        "Files: [configuration](config.yaml), [answers](predictions.jsonl), [votes](votes.jsonl), "
        "[questions](questions.jsonl), [figures](metrics.json), [machine](run.json).",
    ]


def _write_csv(path: Path, sheet: Sheet) -> None:
    with replacing(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(sheet.columns)
        writer.writerows(sheet.rows)
