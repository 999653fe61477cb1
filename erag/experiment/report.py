"""The report of a run: Markdown, CSV, JSON and pictures, computed from the files of its folder alone."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erag.core.output import replacing
from erag.experiment.agreement import AgreementRow
from erag.experiment.capabilities import capabilities
from erag.experiment.config import ExperimentConfig, TableConfig
from erag.experiment.costs import costs
from erag.experiment.figures import draw
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
    agreement: Sequence[AgreementRow]
    facts: dict[str, Any]

    @classmethod
    def of(cls, folder: Folder) -> Material:
        return cls(
            read_predictions(folder.predictions),
            read_records(folder.questions, QuestionRecord),
            read_records(folder.votes, Voted),
            read_records(folder.texts, TextScored),
            read_records(folder.agreement, AgreementRow),
            json.loads(folder.facts.read_text(encoding="utf-8")) if folder.facts.is_file() else {},
        )


def write_report(config: ExperimentConfig, folder: Folder) -> None:
    """Write the page, a CSV file a table, `metrics.json` and the pictures."""
    material = Material.of(folder)
    by = stacked if config.panel.probability == "stack" else mean_vote()
    scores = scored(material.predictions, material.questions, material.votes, material.texts, by)
    choices = choices_of(config, scores)
    tables = [table(t, data, scores, choices) for t in config.tables for data in _data(t, config)]
    tables = [t for t in tables if t.rows]
    sheets = [s for t in tables for s in (table_sheet(t), *tests_sheet(t))]
    sheets += sensitivity(config, material.predictions, material.questions, material.votes, material.facts)
    sheets += capabilities(scores, choices.systems) if config.capabilities else []
    sheets += costs(scores, choices.systems)
    sheets += agreement_sheet(material.agreement, material.facts)
    pictures = draw(config, tables, scores, material.agreement, folder.path) if config.pictures else []
    for old in folder.path.glob("*.csv"):
        old.unlink()
    for sheet in sheets:
        _write_csv(folder.path / f"{sheet.name}.csv", sheet)
    with replacing(folder.metrics) as file:
        json.dump(_metrics(tables), file, indent=1, ensure_ascii=False)
        file.write("\n")
    with replacing(folder.page) as file:
        file.writelines(f"{line}\n" for line in _page(config, material, sheets, pictures))


def choices_of(config: ExperimentConfig, scores: Sequence[Scored]) -> Choices:
    """The order of rows, and which systems are flat: those that say so, else by the kind of their retriever."""
    asked = {s.prediction.system for s in scores}
    names = [n for n in config.systems if n in asked]
    flat = frozenset(n for n in names if config.systems[n].flat or (_by_kind(config, n)))
    return Choices(names, flat, config.intervals == "environments", config.seed)


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
    config: ExperimentConfig, material: Material, sheets: Sequence[Sheet], pictures: Sequence[tuple[str, str]]
) -> list[str]:
    facts, lines = material.facts, [f"# {config.title}", ""]
    lines += [f"* {note}" for note in config.notes] + ([""] if config.notes else [])
    systems = {name: system.note for name, system in config.systems.items() if system.note}
    if systems:
        lines += [*heading("Systems"), *(f"* **{name}**: {note}" for name, note in systems.items()), ""]
    for sheet in sheets:
        lines += sheet_lines(sheet)
    for name, told in pictures:
        lines += [f"![{told}]({name})", ""]
    return [*lines, *heading("Made with"), *_made_with(config, facts)]


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
