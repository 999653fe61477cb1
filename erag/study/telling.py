"""Summaries as a task for a language model: facts of a cluster, and what was accepted of a teacher's answers."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from erag.core.errors import BadModelOutput, InputError
from erag.core.progress import Progress, quiet
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.forest.summaries import Accepted, Summaries, SummaryConfig
from erag.forest.terms import mentions
from erag.lm import prompts
from erag.lm.adapter import embedder_of
from erag.lm.records import SUMMARY
from erag.lm.roles import Group, LMBackend, RoleName, Summary
from erag.lm.textroles import TextRolesConfig
from erag.lm.weights import ModelStore
from erag.pipeline.load import load
from erag.pipeline.records import calls_of
from erag.study.lessons import Answer, Lesson
from erag.study.loraconfig import TellingTask
from erag.study.places import summarised
from erag.study.vectors import KeptVectors

LEFT, TOLD, STRANGE = "parts left by the check", "listed things told", "words in no list"
NEAR = "cosine to the teacher's summary"
_PARTS = re.compile(r"[,;]")


class Telling:
    """Clusters with facts whose summaries were accepted: an item a cluster, and those of one place are one group.

    They are read at construction, once the teacher has summarised the places that the configuration names. What was
    taken out of a teacher's answers is not taught, and neither are clusters whose summary is not wholly its own.
    """

    role: RoleName = "summarise"
    text = TextRolesConfig()

    def __init__(self, config: TellingTask, store: ModelStore, progress: Progress = quiet) -> None:
        made = {} if config.places is None else summarised(config.places, store, progress)
        memories = {**{path: str(path.resolve()) for path in config.memories}, **made}
        some = [(place, item) for path, place in memories.items() for item in _accepted(path, config.summaries)]
        if not some:
            raise InputError(
                "no summary is recorded that was accepted", where=", ".join(map(str, memories)), repair="erag build"
            )
        self._embed = KeptVectors(embedder_of(config.embedder, store), config.vectors)
        self._items = [item for _, item in some]
        self.quotable = not config.memories
        self.groups = [place for place, _ in some]
        self.asked = [" / ".join(item.group.facts) for item in self._items]
        self.taught = [_answer(item.summary) for item in self._items]

    def lessons(self, row: int) -> list[Lesson]:
        """The prompt of the summariser, and the teacher's summary as JSON of its schema."""
        name, text, *how = self.taught[row]
        said = {"summary": text, "name": name, "relationships": how}
        return [Lesson(prompts.summarise(self._items[row].group), json.dumps(said, ensure_ascii=False))]

    def answers(self, backend: LMBackend, rows: Sequence[int]) -> list[Answer]:
        """Name, text and relationships of each."""
        return [_answer(summary) for summary in backend.summarise([self._items[row].group for row in rows])]

    def others(self, fold: IntArray) -> Mapping[str, Sequence[Answer | None]]:
        """What the teacher said: the figures that do not compare with it are its own as well."""
        del fold
        return {"the teacher": self.taught}

    def figures(self, rows: Sequence[int], answers: Sequence[Answer], resamples: int) -> dict[str, Interval]:
        """What a build would keep of it, what of the lists is told, what beside them, and how near the teacher is."""
        left, told, strange = [], [], []
        for row, answer in zip(rows, answers, strict=True):
            item = self._items[row]
            group, spoken = item.group, mentions(". ".join(answer)).words
            known = mentions(". ".join((*group.facts, *group.texts))).words
            listed = [mentions(p).words for fact in group.facts for p in _PARTS.split(fact.partition(":")[2])]
            wanted = [words for words in listed if words]
            kept = item.left(Summary(answer[0], answer[1], answer[2:]))
            left.append(sum(map(bool, (kept.name, kept.text, kept.relationships))) / 3)
            told.append(sum(words <= spoken for words in wanted) / max(len(wanted), 1))
            strange.append(len(spoken - known) / max(len(spoken), 1))
        own, theirs = (self._embed([". ".join(part) for part in parts]) for parts in (answers, self._of(rows)))
        values = {LEFT: left, TOLD: told, STRANGE: strange, NEAR: (own * theirs).sum(axis=1).tolist()}
        places = [self.groups[row] for row in rows]
        return {name: clustered_bootstrap(own, places, samples=resamples) for name, own in values.items()}

    def _of(self, rows: Sequence[int]) -> list[Answer]:
        return [self.taught[row] for row in rows]


def _answer(summary: Summary) -> Answer:
    return (summary.name, summary.text, *summary.relationships)


class _Recorded:
    """Says what a memory has recorded, and nothing else."""

    def __init__(self, path: Path) -> None:
        self._said: dict[Group, Summary] = {}
        for record in calls_of(path, "summarise"):
            raw = json.loads(record.request)
            self._said[Group(tuple(raw["texts"]), tuple(raw["facts"]))] = SUMMARY.decode(record.result)

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        """Raises BadModelOutput where one of the groups was never asked about."""
        try:
            return [self._said[group] for group in groups]
        except KeyError:
            raise BadModelOutput("no such summary is recorded") from None


def _accepted(path: Path, config: SummaryConfig) -> Iterator[Accepted]:
    """The clusters of a memory with name, text and relationships by whoever summarised it, level by level."""
    corpus = load(path).corpus
    summaries = Summaries(corpus.topomap, _Recorded(path), config)
    clusters = corpus.forest.clusters
    for level in sorted({cluster.level for cluster in clusters}):
        for item in summaries.accepted([cluster for cluster in clusters if cluster.level == level]):
            if item.summary.name and item.summary.text and item.summary.relationships:
                yield item
