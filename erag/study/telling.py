"""Summaries as a task for a language model: facts of a cluster, and what a teacher made of them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.forest.terms import mentions
from erag.lm import prompts
from erag.lm.adapter import embedder_of
from erag.lm.records import SUMMARY
from erag.lm.roles import Group, LMBackend, RoleName, Summary
from erag.lm.textroles import TextRolesConfig
from erag.lm.weights import ModelStore
from erag.study.lessons import Answer, Lesson
from erag.study.loraconfig import TellingTask
from erag.study.places import summarised
from erag.study.vectors import KeptVectors

TOLD, STRANGE, NEAR = "listed things told", "words in no list", "cosine to the teacher's summary"
_PARTS = re.compile(r"[,;]")


class Telling:
    """Recorded summaries of clusters with facts; those of one memory, a place, are one group.

    They are read at construction, once the teacher has summarised the places that the configuration names.
    """

    role: RoleName = "summarise"
    text = TextRolesConfig()
    quotable = True

    def __init__(self, config: TellingTask, store: ModelStore, progress: Progress = quiet) -> None:
        made = [] if config.places is None else summarised(config.places, store, progress)
        memories = [*config.memories, *made]
        some = [item for path in memories for item in _recorded(path)]
        if not some:
            raise InputError("no summary is recorded", where=", ".join(map(str, memories)), repair="erag build")
        self._embed = KeptVectors(embedder_of(config.embedder, store), config.vectors)
        self._groups = [group for _, group, _ in some]
        self.groups = [place for place, _, _ in some]
        self.asked = [" / ".join(group.facts) for group in self._groups]
        self.taught = [_answer(summary) for _, _, summary in some]

    def lessons(self, row: int) -> list[Lesson]:
        """The prompt of the summariser, and the teacher's summary as JSON of its schema."""
        name, text, *how = self.taught[row]
        said = {"summary": text, "name": name, "relationships": how}
        return [Lesson(prompts.summarise(self._groups[row]), json.dumps(said, ensure_ascii=False))]

    def answers(self, backend: LMBackend, rows: Sequence[int]) -> list[Answer]:
        """Name, text and relationships of each."""
        return [_answer(summary) for summary in backend.summarise([self._groups[row] for row in rows])]

    def others(self, fold: IntArray) -> Mapping[str, Sequence[Answer | None]]:
        """What the teacher said: the figures that do not compare with it are its own as well."""
        del fold
        return {"the teacher": self.taught}

    def figures(self, rows: Sequence[int], answers: Sequence[Answer], resamples: int) -> dict[str, Interval]:
        """What of the lists is told, what is told beside them, and how near the teacher's words are."""
        told, strange = [], []
        for row, answer in zip(rows, answers, strict=True):
            group, spoken = self._groups[row], mentions(". ".join(answer)).words
            known = mentions(". ".join((*group.facts, *group.texts))).words
            listed = [mentions(p).words for fact in group.facts for p in _PARTS.split(fact.partition(":")[2])]
            wanted = [words for words in listed if words]
            told.append(sum(words <= spoken for words in wanted) / max(len(wanted), 1))
            strange.append(len(spoken - known) / max(len(spoken), 1))
        own, theirs = (self._embed([". ".join(part) for part in parts]) for parts in (answers, self._of(rows)))
        values = {TOLD: told, STRANGE: strange, NEAR: (own * theirs).sum(axis=1).tolist()}
        places = [self.groups[row] for row in rows]
        return {name: clustered_bootstrap(own, places, samples=resamples) for name, own in values.items()}

    def _of(self, rows: Sequence[int]) -> list[Answer]:
        return [self.taught[row] for row in rows]


def _answer(summary: Summary) -> Answer:
    return (summary.name, summary.text, *summary.relationships)


def _recorded(path: Path) -> Iterator[tuple[str, Group, Summary]]:
    """The place, facts and summary of each recorded call about a cluster that has facts."""
    from erag.memory.database import Database

    database = Database(path, "read")
    try:
        rows = database.rows("SELECT request, result FROM call_results WHERE role = 'summarise' ORDER BY key")
    finally:
        database.close()
    for request, result in rows:
        raw = json.loads(request)
        if raw["facts"]:
            yield path.stem, Group(tuple(raw["texts"]), tuple(raw["facts"])), SUMMARY.decode(result)
