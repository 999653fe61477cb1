"""From what a teacher names for many wishes to a student that names without a language model."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.text import clean, content_hash
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.lm.adapter import Embed, embedder_of
from erag.lm.checkpoints import save
from erag.lm.config import BackendConfig, build_backend
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.understanding import HEADER, UnderstandingHeader, distinct, shares
from erag.lm.weights import ModelStore
from erag.study.pairs import folds
from erag.study.shown import Shown
from erag.study.teacher import Taught, taught
from erag.study.textcard import understanding_card
from erag.study.textconfig import UnderstandingDistil
from erag.study.vectors import KeptVectors
from erag.study.wishes import wishes

if TYPE_CHECKING:
    from erag.lm.understanding_network import UnderstandingNetwork

Floats = npt.NDArray[np.float32]
STUDENT = "this student"
FOUND, NEAR = "teacher's things named", "cosine to the teacher's answer"
_NAMED = 5  # things a student names when it is judged


@dataclass(frozen=True, eq=False)
class Lessons:
    """w wishes with their needs, t things, the rows of the things named for each wish, and vectors of all."""

    wishes: tuple[str, ...]
    needs: tuple[str, ...]
    things: tuple[str, ...]
    named: tuple[tuple[int, ...], ...]
    wish_vectors: Vectors
    thing_vectors: Vectors
    shared: Floats  # (w, t)

    def header(self, config: UnderstandingDistil, embedder: str, rows: Sequence[int]) -> UnderstandingHeader:
        """The header of a student that has seen the wishes `rows`."""
        return UnderstandingHeader(
            dim=self.wish_vectors.shape[1], rank=config.rank, members=config.members, embedder=embedder,
            taught_by=config.taught_by, things=self.things, named=tuple(self.named[row] for row in rows),
        )  # fmt: skip


@dataclass(frozen=True)
class Report:
    """What came of it: by way of naming the share of the teacher's things named and the cosine to its answer."""

    out: Path
    bytes: int
    wishes: int
    needs: int
    things: int
    failed: int
    figures: Mapping[str, Mapping[str, Interval]]
    examples: Sequence[tuple[str, str, str]]  # wish, teacher, student
    seconds: Mapping[str, float]

    def table(self) -> Shown:
        """The figures for the terminal."""
        columns = (FOUND, NEAR)
        rows = [(name, *(str(own[column]) for column in columns)) for name, own in self.figures.items()]
        return Shown(("named by", *columns), rows)


def distil(config: UnderstandingDistil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Ask the teacher, train, judge on needs left out, and write the student with its card. Resumable throughout.

    Raises InputError where the teacher names too little to learn from.
    """
    go_offline()
    clock = [time.perf_counter()]
    teacher = build_backend(BackendConfig(models={"teacher": config.teacher}, roles={"generate": "teacher"}), store)
    said = wishes(config.ways, config.training.seed)[: config.limit]
    rows = taught(teacher, said, config.work / "teacher.jsonl", config.things, progress)
    clock.append(time.perf_counter())
    embedder = embedder_of(config.embedder, store)
    embed = KeptVectors(embedder, config.work / "vectors")
    lessons = read_lessons(rows, config.fewest, embed)
    run = _Run(config, lessons, embedder.identity("embed"), progress)
    names = run.left_out()
    clock.append(time.perf_counter())
    every = range(len(lessons.wishes))
    network = run.trained("all", every)
    state = {name: tensor for name, tensor in network.state_dict().items() if name != "named"}
    save(config.out, HEADER, lessons.header(config, embedder.identity("embed"), every), state)
    clock.append(time.perf_counter())
    report = Report(
        config.out, config.out.stat().st_size, len(lessons.wishes), len(set(lessons.needs)), len(lessons.things),
        len(rows) - len(lessons.wishes), _figures(config, lessons, names, embed), _examples(lessons, names[STUDENT]),
        dict(zip(("teacher", "folds", "train"), np.diff(clock).tolist(), strict=True)),
    )  # fmt: skip
    config.out.with_suffix(".md").write_text(understanding_card(config, report), encoding="utf-8")
    (config.work / "figures.json").write_text(json.dumps(asdict(report), indent=1, default=str), encoding="utf-8")
    return report


def read_lessons(rows: Sequence[Taught], fewest: int, embed: Embed) -> Lessons:
    """Wishes for which things are named that are named often enough. Raises InputError where none is left."""
    cleaned = [[clean(thing).lower() for thing in row.things] for row in rows]
    often = Counter(thing for things in cleaned for thing in set(things))
    things = tuple(sorted(thing for thing, count in often.items() if count >= fewest))
    place = {thing: row for row, thing in enumerate(things)}
    named = [tuple(dict.fromkeys(place[t] for t in things if t in place)) for things in cleaned]
    kept = [i for i, found in enumerate(named) if found]
    if not kept:
        raise InputError(f"no thing is named for {fewest} of {len(rows)} wishes", repair="more wishes, a lower fewest")
    wished = tuple(rows[i].wish for i in kept)
    return Lessons(
        wished, tuple(str(rows[i].need) for i in kept), things, tuple(named[i] for i in kept), embed(wished),
        embed(things), shares(wished, things),
    )  # fmt: skip


class _Run:
    """Trainings under a folder named by everything the weights depend on."""

    def __init__(self, config: UnderstandingDistil, lessons: Lessons, embedder: str, progress: Progress) -> None:
        trained = config.training.model_dump_json(exclude={"wandb", "threads"})
        header = lessons.header(config, embedder, range(len(lessons.wishes))).model_dump_json()
        sums = [repr(float(v.sum(dtype=np.float64))) for v in (lessons.wish_vectors, lessons.thing_vectors)]
        key = content_hash(trained, header, str(config.folds), *lessons.wishes, *sums).hex()[:12]
        self._config, self._lessons, self._embedder, self._progress = config, lessons, embedder, progress
        self._folder = config.work / f"run-{key}"

    def trained(self, name: str, rows: Sequence[int]) -> UnderstandingNetwork:
        from erag.study.naming import train

        def told(stage: str, done: int, total: int) -> None:
            self._progress(f"{name}: {stage}", done, total)

        header = self._lessons.header(self._config, self._embedder, rows)
        return train(header, self._config, self._lessons, rows, self._folder / name, told)

    def left_out(self) -> dict[str, list[tuple[str, ...]]]:
        """What each way of naming names for every wish, having seen nothing of its need."""
        from erag.study.naming import ways

        lessons = self._lessons
        fold = folds(lessons.needs, self._config.folds, self._config.training.seed)
        names: dict[str, list[tuple[str, ...]]] = {}
        for number in range(self._config.folds):
            out = np.flatnonzero(fold == number)
            if not len(out):
                continue
            network = self.trained(f"fold-{number}", np.flatnonzero(fold != number).tolist())
            for way, chances in ways(network, lessons, out.tolist()).items():
                own = names.setdefault(way, [()] * len(lessons.wishes))
                for row, chance in zip(out, chances, strict=True):
                    best = distinct(chance, lessons.thing_vectors, _NAMED)
                    own[row] = tuple(lessons.things[i] for i in best)
        return names


def _figures(
    config: UnderstandingDistil, lessons: Lessons, names: Mapping[str, Sequence[tuple[str, ...]]], embed: Embed
) -> dict[str, dict[str, Interval]]:
    teacher = [tuple(lessons.things[i] for i in named[:_NAMED]) for named in lessons.named]
    truth = embed([", ".join(things) for things in teacher])
    figures: dict[str, dict[str, Interval]] = {}
    for way, own in {"the query itself": [(wish,) for wish in lessons.wishes], **names}.items():
        found = [len(set(mine) & set(theirs)) / len(theirs) for mine, theirs in zip(own, teacher, strict=True)]
        near = (embed([", ".join(things) for things in own]) * truth).sum(axis=1).tolist()
        figures[way] = {
            FOUND: clustered_bootstrap(found, lessons.needs, samples=config.resamples),
            NEAR: clustered_bootstrap(near, lessons.needs, samples=config.resamples),
        }
    return figures


def _examples(lessons: Lessons, names: Sequence[tuple[str, ...]]) -> list[tuple[str, str, str]]:
    some = range(0, len(lessons.wishes), max(1, len(lessons.wishes) // 10))
    teacher = [", ".join(lessons.things[i] for i in lessons.named[row]) for row in some]
    return [(lessons.wishes[row], theirs, ", ".join(names[row])) for row, theirs in zip(some, teacher, strict=True)]
