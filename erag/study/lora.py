"""From a teacher's answers to a small language model that answers like it: adapter, figures on items left out, card."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.evaluate.statistics import Interval
from erag.lm.offline import go_offline
from erag.lm.weights import ModelStore
from erag.study.choosing import Choosing
from erag.study.lessons import Answer, Task
from erag.study.loracard import lora_card
from erag.study.loraconfig import ChoosingTask, LoraDistil, LoraTask, NamingTask, TellingTask
from erag.study.naming import Naming
from erag.study.pairs import folds
from erag.study.shown import Shown
from erag.study.telling import Telling
from erag.study.tutor import UNTAUGHT, Tutor

_EXAMPLES = 10


@dataclass(frozen=True)
class Report:
    """What came of it: figures by way of answering, over `judged` of `items` items, and over how many of them.

    The items are in `groups` groups, those that were judged in `judged_groups`.

    `taught` items became `lessons` for the adapter that was written. `files` are the bytes of the base and of the
    merged ones; `examples` items with the answers of the teacher, of the base and of the student, which had not seen
    them.
    """

    out: Path
    bytes: int
    items: int
    groups: int
    taught: int
    lessons: int
    judged: int
    judged_groups: int
    figures: Mapping[str, Mapping[str, Interval]]
    counted: Mapping[str, int]
    files: Mapping[str, int]
    examples: Sequence[tuple[str, str, str, str]]
    seconds: Mapping[str, float]

    def table(self) -> Shown:
        """The figures for the terminal."""
        columns = tuple(next(iter(self.figures.values())))
        rows = [(way, *(own[column].shown(3) for column in columns)) for way, own in self.figures.items()]
        return Shown(("answered by", *columns), rows)


def distil(config: LoraDistil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Ask the teacher, train, judge on items left out, and write the adapter with its card. Resumable, epoch by epoch.

    Raises InputError for items that cannot be read or are too few, ModelError for a base that cannot be
    trained or merged.
    """
    go_offline()
    clock = [time.perf_counter()]
    task = _task(config.task, store, progress)
    tutor = Tutor(config, task, store, progress)
    clock.append(time.perf_counter())
    if len(set(task.groups)) < config.folds:
        what = f"{len(set(task.groups))} groups of items for {config.folds} folds"
        raise InputError(what, allowed="a group a fold at least", repair="fewer folds, or more groups")
    fold = folds(task.groups, config.folds, config.training.seed)
    judged = [np.flatnonzero(fold == number).tolist() for number in range(config.judged)]
    parts = [
        tutor.left_out(f"fold-{number}", _some(np.flatnonzero(fold != number).tolist(), config.most), out)
        for number, out in enumerate(judged)
    ]
    clock.append(time.perf_counter())
    taught = _some(range(len(task.groups)), config.most)
    tutor.train("all", taught, config.out)
    clock.append(time.perf_counter())
    rows = [row for out in judged for row in out]
    forms = {form: [answer for part in parts for answer in part[form].answers] for form in parts[0]}
    answers: dict[str, Sequence[Answer | None]] = {
        **{way: [own[row] for row in rows] for way, own in task.others(fold).items()},
        **{called(config.base, form): own for form, own in forms.items()},
    }
    figures, counted = _figures(config, task, rows, answers)
    report = Report(
        out=config.out, bytes=config.out.stat().st_size, items=len(task.groups), groups=len(set(task.groups)),
        taught=len(taught), lessons=sum(len(tutor.lessons[row]) for row in taught), judged=len(rows),
        judged_groups=len({task.groups[row] for row in rows}), figures=figures,
        counted=counted, files={called(config.base, form): one.bytes for form, one in parts[0].items()},
        examples=_examples(task, rows, forms[UNTAUGHT], forms[config.forms[0]]),
        seconds=dict(zip(("teacher", "folds", "train"), np.diff(clock).tolist(), strict=True)),
    )  # fmt: skip
    config.out.with_suffix(".md").write_text(lora_card(config, report), encoding="utf-8")
    (config.work / "figures.json").write_text(json.dumps(asdict(report), indent=1, default=str), encoding="utf-8")
    return report


def _some(rows: Sequence[int], most: int | None) -> list[int]:
    """At most so many of the rows, evenly among them."""
    if most is None or most >= len(rows):
        return list(rows)
    return [rows[i * len(rows) // most] for i in range(most)]


def called(base: str, form: str) -> str:
    """What a table calls a form of the student, and the base as it was."""
    return f"{base}, {UNTAUGHT}" if form == UNTAUGHT else f"this student, {form.upper()}"


def _task(config: LoraTask, store: ModelStore, progress: Progress) -> Task:
    match config:
        case ChoosingTask():
            return Choosing(config)
        case TellingTask():
            return Telling(config, store, progress)
        case NamingTask():
            return Naming(config, store, progress)


def _figures(
    config: LoraDistil, task: Task, rows: Sequence[int], answers: Mapping[str, Sequence[Answer | None]]
) -> tuple[dict[str, dict[str, Interval]], dict[str, int]]:
    """The figures of each way over the items that it answers, and how many these are."""
    figures, counted = {}, {}
    for way, own in answers.items():
        given = [(row, answer) for row, answer in zip(rows, own, strict=True) if answer is not None]
        if given:
            counted[way] = len(given)
            figures[way] = task.figures([row for row, _ in given], [answer for _, answer in given], config.resamples)
    return figures, counted


def _examples(
    task: Task, rows: Sequence[int], before: Sequence[Answer], after: Sequence[Answer]
) -> list[tuple[str, str, str, str]]:
    some = range(0, len(rows) if task.quotable else 0, max(1, len(rows) // _EXAMPLES))
    return [
        (task.asked[rows[i]], ", ".join(task.taught[rows[i]]), ", ".join(before[i]), ", ".join(after[i])) for i in some
    ]
