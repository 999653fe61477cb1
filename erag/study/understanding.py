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
from erag.core.text import clean
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.lm.adapter import Embed, embedder_of
from erag.lm.checkpoints import save
from erag.lm.config import BackendConfig, build_backend
from erag.lm.offline import go_offline
from erag.lm.roles import Vectors
from erag.lm.understanding import HEADER, Names, UnderstandingHeader, distinct
from erag.lm.weights import ModelStore
from erag.study.pairs import folds
from erag.study.shown import Shown
from erag.study.teacher import Taught, taught
from erag.study.textcard import understanding_card
from erag.study.textconfig import UnderstandingDistil, Wishing
from erag.study.vectors import KeptVectors
from erag.study.wishes import wishes

if TYPE_CHECKING:
    import torch

STUDENT = "this student"
FOUND, NEAR = "teacher's things named", "cosine to the teacher's answer"
NAMED = 5  # things a student names when it is judged
_UNNAMED = 0.5  # added to how often a thing was named
_NO_THINGS = frozenset(
    {"hello", "hello world", "hi", "hi there", "no", "ok", "okay", "sorry", "thanks", "world", "yes"}
)


@dataclass(frozen=True, eq=False)
class Lessons:
    """w wishes with their needs, t things, the rows of the things named for each wish, and unit vectors of all."""

    wishes: tuple[str, ...]
    needs: tuple[str, ...]
    things: tuple[str, ...]
    named: tuple[tuple[int, ...], ...]
    wish_vectors: Vectors
    thing_vectors: Vectors

    def taught(self) -> list[tuple[str, ...]]:
        """(w,) the things that the teacher named for each wish, as many as a student may name."""
        return [tuple(self.things[i] for i in named[:NAMED]) for named in self.named]

    def learnt(self, config: Wishing, rows: Sequence[int]) -> Names:
        """What is known after the wishes `rows`, by ridge regression towards the centroids of what was named."""
        picked = list(rows)
        queries, shares = self.wish_vectors[picked].astype(np.float64), self._shares(picked)
        centroids = shares @ self.thing_vectors
        centroids /= np.maximum(np.linalg.norm(centroids, axis=1, keepdims=True), 1e-12)
        penalty = config.ridge * np.eye(queries.shape[1])
        projection = np.linalg.solve(queries.T @ queries + penalty, queries.T @ (centroids - queries))
        prior = config.prior * np.log(shares.sum(axis=0) + _UNNAMED)
        return Names(self.thing_vectors, projection.astype(np.float32), prior.astype(np.float32), config.blend)

    def _shares(self, rows: Sequence[int]) -> npt.NDArray[np.float64]:
        """(w, t) what was named for each wish, earlier names counting more, each row with sum 1."""
        found = np.zeros((len(rows), len(self.things)))
        for row, number in zip(found, rows, strict=True):
            for place, thing in enumerate(self.named[number]):
                row[thing] += 1 / (1 + place)
        total: npt.NDArray[np.float64] = found.sum(axis=1, keepdims=True)
        return np.asarray(found / total, np.float64)


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
    """Ask the teacher, learn, judge on needs left out, and write the student with its card. Asked once, it resumes.

    Raises InputError where the teacher names too little to learn from.
    """
    go_offline()
    clock = [time.perf_counter()]
    rows = named_by_teacher(config, store, progress)
    clock.append(time.perf_counter())
    embedder = embedder_of(config.embedder, store)
    embed = KeptVectors(embedder, config.work / "vectors")
    lessons = read_lessons(rows, config.fewest, embed)
    names = left_out(config, lessons, folds(lessons.needs, config.folds, config.seed))
    clock.append(time.perf_counter())
    learnt = lessons.learnt(config, range(len(lessons.wishes)))
    header = UnderstandingHeader(
        dim=learnt.things.shape[1], embedder=embedder.identity("embed"), blend=config.blend, things=lessons.things,
        taught_by=config.taught_by,
    )  # fmt: skip
    save(config.out, HEADER, header, _tensors(learnt))
    clock.append(time.perf_counter())
    report = Report(
        config.out, config.out.stat().st_size, len(lessons.wishes), len(set(lessons.needs)), len(lessons.things),
        len(rows) - len(lessons.wishes), _figures(config, lessons, names, embed), _examples(lessons, names[STUDENT]),
        dict(zip(("teacher", "folds", "learn"), np.diff(clock).tolist(), strict=True)),
    )  # fmt: skip
    config.out.with_suffix(".md").write_text(understanding_card(config, report), encoding="utf-8")
    (config.work / "figures.json").write_text(json.dumps(asdict(report), indent=1, default=str), encoding="utf-8")
    return report


def named_by_teacher(config: Wishing, store: ModelStore, progress: Progress) -> list[Taught]:
    """What the teacher names for each wish; what it has named before is not asked again."""
    teacher = build_backend(BackendConfig(models={"teacher": config.teacher}, roles={"generate": "teacher"}), store)
    said = wishes(config.ways, config.seed)[: config.limit]
    return taught(teacher, said, config.work / "teacher.jsonl", config.things, progress)


def read_lessons(rows: Sequence[Taught], fewest: int, embed: Embed) -> Lessons:
    """Wishes for which things are named that are named often enough. Raises InputError where none is left."""
    cleaned = [[thing for t in row.things if (thing := clean(t).lower()) not in _NO_THINGS] for row in rows]
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
        embed(things),
    )  # fmt: skip


def left_out(config: Wishing, lessons: Lessons, fold: IntArray) -> dict[str, list[tuple[str, ...]]]:
    """What each way of naming names for every wish, having seen nothing of its fold (w,), and so of its need."""
    names: dict[str, list[tuple[str, ...]]] = {
        way: [()] * len(lessons.wishes) for way in ("nearest things", "projection alone", STUDENT)
    }
    for number in np.unique(fold):
        out = np.flatnonzero(fold == number)
        learnt = lessons.learnt(config, np.flatnonzero(fold != number).tolist())
        queries = lessons.wish_vectors[out]
        scores = (queries @ learnt.things.T, queries @ learnt.projection @ learnt.things.T, learnt.scores(queries))
        for way, own in zip(names, scores, strict=True):
            for row, score in zip(out.tolist(), np.asarray(own), strict=True):
                best = distinct(score, lessons.thing_vectors, NAMED)
                names[way][row] = tuple(lessons.things[i] for i in best)
    return names


def _tensors(learnt: Names) -> dict[str, torch.Tensor]:
    import torch

    known = {"things": learnt.things, "projection": learnt.projection, "prior": learnt.prior}
    return {name: torch.from_numpy(values) for name, values in known.items()}


def _figures(
    config: UnderstandingDistil, lessons: Lessons, names: Mapping[str, Sequence[tuple[str, ...]]], embed: Embed
) -> dict[str, dict[str, Interval]]:
    teacher = lessons.taught()
    ways = {"the query itself": [(wish,) for wish in lessons.wishes], **names}
    return {way: agreement(own, teacher, lessons.needs, embed, config.resamples) for way, own in ways.items()}


def agreement(
    names: Sequence[tuple[str, ...]], teacher: Sequence[tuple[str, ...]], needs: Sequence[str], embed: Embed,
    resamples: int,
) -> dict[str, Interval]:  # fmt: skip
    """How far the names of things for each wish are those of its teacher; intervals are over needs."""
    found = [len(set(mine) & set(theirs)) / len(theirs) for mine, theirs in zip(names, teacher, strict=True)]
    near = (embed([", ".join(mine) for mine in names]) * embed([", ".join(theirs) for theirs in teacher])).sum(axis=1)
    return {
        FOUND: clustered_bootstrap(found, needs, samples=resamples),
        NEAR: clustered_bootstrap(near.tolist(), needs, samples=resamples),
    }


def _examples(lessons: Lessons, names: Sequence[tuple[str, ...]]) -> list[tuple[str, str, str]]:
    some = range(0, len(lessons.wishes), max(1, len(lessons.wishes) // 10))
    teacher = [", ".join(lessons.things[i] for i in lessons.named[row]) for row in some]
    return [(lessons.wishes[row], theirs, ", ".join(names[row])) for row, theirs in zip(some, teacher, strict=True)]
