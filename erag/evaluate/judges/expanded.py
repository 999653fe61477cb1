"""A judge asked more than once: by the question, and by what would satisfy it (`caffeine`: a café)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from erag.evaluate.judges.protocol import Floats, Judge
from erag.evaluate.truth import Asked, Pair


@dataclass(frozen=True)
class ExpandedJudge:
    """P = the largest vote over the question and its expansions.

    `expansions` maps a question's id to texts, written by people or by a model (whose identity then belongs in
    `expanded_by`); a question it does not hold is expanded by its `targets`. An expansion is a question of its own to
    the judge, without targets. It abstains where the judge abstains on all of them.
    """

    judge: Judge
    expansions: Mapping[str, Sequence[str]] = field(default_factory=dict)
    expanded_by: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        return f"{self.judge.name}, expanded"

    @property
    def models(self) -> frozenset[str]:
        return self.judge.models | self.expanded_by

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. The judge is called once, with all pairs and their expansions."""
        if not pairs:
            return np.empty(0)
        versions = {asked: self._versions(asked) for asked in {p.asked for p in pairs}}
        spread = [Pair(asked, p.truth) for p in pairs for asked in versions[p.asked]]
        votes = np.asarray(self.judge.probabilities(spread), np.float64)
        first = np.cumsum([0, *(len(versions[p.asked]) for p in pairs[:-1])])
        return np.asarray(np.fmax.reduceat(votes, first))  # fmax passes over abstentions

    def _versions(self, asked: Asked) -> tuple[Asked, ...]:
        texts = self.expansions.get(asked.id)
        if texts is None:
            texts = sorted(asked.targets or ())
        return (asked, *(replace(asked, text=text, targets=None) for text in texts))
