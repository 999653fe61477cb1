"""Choices among cards as a task for a language model: whether a card is the one, card by card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.lm import prompts
from erag.lm.roles import LMBackend, RoleName, SelectTask
from erag.lm.textroles import TextRolesConfig
from erag.study.decisions import read_decisions
from erag.study.lessons import Answer, Lesson
from erag.study.loraconfig import ChoosingTask

AGREES = "agreement with the teacher"


class Choosing:
    """The decisions of a teacher; they are read at construction."""

    role: RoleName = "select"
    text = TextRolesConfig(selector="yes_no", scorer="yes_no")
    quotable = False

    def __init__(self, config: ChoosingTask) -> None:
        self._decisions = read_decisions(config.decisions)
        self.groups = [d.query if config.split == "questions" else d.group for d in self._decisions]
        self.asked = [d.query for d in self._decisions]
        self.taught: Sequence[Answer] = [(d.cards[d.chosen],) for d in self._decisions]

    def lessons(self, row: int) -> list[Lesson]:
        """One a card of other text: the question of the selector `yes_no`, and Yes for the card that was chosen."""
        decision = self._decisions[row]
        chosen = decision.cards[decision.chosen]
        return [
            Lesson(
                prompts.yes_no(decision.query, card, self.text.query_chars, self.text.card_chars),
                prompts.YES if card == chosen else prompts.NO,
            )
            for card in dict.fromkeys(decision.cards)
        ]

    def answers(self, backend: LMBackend, rows: Sequence[int]) -> list[Answer]:
        """The text of the card it chooses."""
        some = [self._decisions[row] for row in rows]
        picks = backend.select([SelectTask(d.query, d.cards) for d in some], 1)
        return [(d.cards[pick[0]],) for d, pick in zip(some, picks, strict=True)]

    def others(self, fold: IntArray) -> Mapping[str, Sequence[Answer | None]]:
        """The first card."""
        del fold
        return {"always first": [(d.cards[0],) for d in self._decisions]}

    def figures(self, rows: Sequence[int], answers: Sequence[Answer], resamples: int) -> dict[str, Interval]:
        """How often it is a card of the text that the teacher chose; the interval is over groups."""
        right = [float(answer == self.taught[row]) for row, answer in zip(rows, answers, strict=True)]
        return {AGREES: clustered_bootstrap(right, [self.groups[row] for row in rows], samples=resamples)}
