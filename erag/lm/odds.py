"""Models that select and score by one number: the log-odds that a card fits a query."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from erag.lm.roles import RoleName, SelectTask, Vectors

Pair = tuple[str, str]  # (query, card)


class Chooser(ABC):
    """The select and score roles of what judges pairs of query and card."""

    roles: frozenset[RoleName] = frozenset({"select", "score"})

    @abstractmethod
    def log_odds(self, pairs: Sequence[Pair], owners: Sequence[int] | None = None) -> Vectors:
        """(p,) float32: the log-odds that the teacher would call the card fitting.

        `owners` (p,) numbers the choice that each card is part of, where it is part of one.
        """

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        """For each task min(k, n) distinct indices of its cards, best first; equal ones by their text."""
        owners = [number for number, task in enumerate(tasks) for _ in task.cards]
        odds = self.log_odds([(task.query, card) for task in tasks for card in task.cards], owners)
        ends = np.cumsum([len(task.cards) for task in tasks])[:-1]
        found = zip(tasks, np.split(odds, ends) if tasks else (), strict=True)
        return [
            sorted(range(len(task.cards)), key=lambda i: (-float(own[i]), task.cards[i], i))[:k] for task, own in found
        ]

    def score(self, pairs: Sequence[Pair]) -> Vectors:
        """(p,) float32 in [0, 1]: the chance that the teacher would call the card fitting, each pair on its own."""
        return (0.5 * (1 + np.tanh(self.log_odds(pairs) / 2))).astype(np.float32)
