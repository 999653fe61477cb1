"""Query understanding as a task for a language model: wishes, and what would satisfy them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from erag.core.progress import Progress
from erag.core.text import clean
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval
from erag.lm.adapter import embedder_of
from erag.lm.roles import LMBackend, RoleName
from erag.lm.textroles import TextRolesConfig
from erag.lm.weights import ModelStore
from erag.retrieve.config import ExpandConfig
from erag.retrieve.expand import Expander, answered, asking
from erag.study.lessons import Answer, Lesson
from erag.study.loraconfig import NamingTask
from erag.study.teacher import named_by
from erag.study.understanding import (
    NAMED,
    STUDENT,
    agreement,
    left_out,
    named_by_teacher,
    read_lessons,
)
from erag.study.vectors import KeptVectors

EMBEDDING = "the student without a language model"
AGAIN = "the teacher, asked in other words"


class Naming:
    """The wishes for which a teacher has named things that it names more than once; asked at construction."""

    role: RoleName = "generate"
    text = TextRolesConfig()
    quotable = True

    def __init__(self, config: NamingTask, store: ModelStore, progress: Progress) -> None:
        self._config = config
        self._embed = KeptVectors(embedder_of(config.embedder, store), config.work / "vectors")
        self._known = read_lessons(named_by_teacher(config, store, progress), config.fewest, self._embed)
        self.groups, self.asked, self.taught = self._known.needs, self._known.wishes, self._known.taught()

    def lessons(self, row: int) -> list[Lesson]:
        """The prompt of `retrieve.expand`, and all things of the teacher's that count."""
        things = [self._known.things[i] for i in self._known.named[row]]
        return [Lesson(asking(self.asked[row], self._config.things).messages, answered(things))]

    def answers(self, backend: LMBackend, rows: Sequence[int]) -> list[Answer]:
        """The things it names, in small letters, as many as the teacher's that count."""
        expander = Expander(backend, ExpandConfig(things=self._config.things))
        named = named_by(expander, [self.asked[row] for row in rows])
        return [tuple(dict.fromkeys(clean(thing).lower() for thing in things))[:NAMED] for things in named]

    def others(self, fold: IntArray) -> Mapping[str, Sequence[Answer | None]]:
        """What the student without a language model names, and what the teacher named for another wording."""
        ways: dict[str, Sequence[Answer | None]] = {}
        for way, names in left_out(self._config, self._known, fold).items():
            if way != "projection alone":
                ways[EMBEDDING if way == STUDENT else way] = names
        return ways | {AGAIN: [self._reworded(row) for row in range(len(self.asked))]}

    def figures(self, rows: Sequence[int], answers: Sequence[Answer], resamples: int) -> dict[str, Interval]:
        """See `understanding.agreement`."""
        teacher, needs = [self.taught[row] for row in rows], [self.groups[row] for row in rows]
        return agreement(answers, teacher, needs, self._embed, resamples)

    def _reworded(self, row: int) -> Answer | None:
        other = [i for i, need in enumerate(self.groups) if need == self.groups[row] and i != row]
        return self.taught[other[0]] if other else None
