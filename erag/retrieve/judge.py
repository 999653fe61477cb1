"""Phase 1 by a language model: cards of the candidates in, rows to follow out (paper: `N_l = f_LM(q, C_l, k)`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.types import IntArray
from erag.lm.roles import Selector, SelectTask, Vectors
from erag.retrieve.corpus import Corpus
from erag.retrieve.scoring import Batch
from erag.retrieve.tree import Choice, ClusterJudge


@dataclass(frozen=True)
class ModelJudge:
    """Lets a selector choose among cards. A choice of no more than k rows takes them all and asks nobody.

    With `evidence` a cluster's card ends with the sentence below it that comes closest to the query.
    """

    corpus: Corpus
    selector: Selector
    evidence: bool

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        """See `ClusterJudge`; all decisions of a level are one call."""
        asked = [i for i, choice in enumerate(choices) if len(choice.rows) > k]
        picked = [choice.rows for choice in choices]
        tasks = [self._task(batch, choices[i]) for i in asked]
        for i, best in zip(asked, self.selector.select(tasks, k) if tasks else [], strict=True):
            picked[i] = choices[i].rows[best]
        return picked

    def _task(self, batch: Batch, choice: Choice) -> SelectTask:
        vector = batch.vectors[choice.query]
        cards = (self._card(int(row), int(best), vector) for row, best in zip(choice.rows, choice.best, strict=True))
        return SelectTask(batch.texts[choice.query], tuple(cards))

    def _card(self, row: int, best: int, vector: Vectors) -> str:
        n = self.corpus.forest.n_leaves
        if row < n:
            return self.corpus.texts[row]
        cluster = self.corpus.forest.clusters[row - n]
        told = f"{cluster.name}. {cluster.summary}".strip(". ")
        return f"{told} One view: {self.corpus.quote(best, vector)}" if self.evidence and best < n else told


@dataclass(frozen=True)
class Shortlisted:
    """Lets `first` pick the `shortlist` most promising rows of each choice, and `then` decide among them."""

    first: ClusterJudge
    then: ClusterJudge
    shortlist: int

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        """See `ClusterJudge`."""
        kept = self.first.choose(batch, choices, max(k, self.shortlist))
        return self.then.choose(batch, [_only(c, rows) for c, rows in zip(choices, kept, strict=True)], k)


def _only(choice: Choice, rows: IntArray) -> Choice:
    kept = np.isin(choice.rows, rows)
    return Choice(choice.query, choice.parent, choice.rows[kept], choice.best[kept])
