"""A language model as a judge: shown the ground truth of a place in words, does it satisfy the question?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.evaluate.judges.protocol import Floats
from erag.evaluate.truth import NodeTruth, Pair
from erag.lm.roles import Scorer


@dataclass(frozen=True)
class ModelJudge:
    """P = the `score` role of a language model for (question, truth in words).

    By `yes_no` that is P(Yes) / (P(Yes) + P(No)) under the committed prompt `erag.lm.prompts.YES_NO`, by `likelihood`
    the logistic function of how much likelier the question is after the place than after none (`ANSWERED`). It reads
    what the truth says, never a system's caption. `models` names the weights. It abstains on a truth without text and
    on an empty question.
    """

    name: str
    scorer: Scorer
    models: frozenset[str] = frozenset()

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. Every distinct question and truth is scored once."""
        said = {id(p.truth): spoken(p.truth) for p in pairs}
        asked = [(p.asked.text.strip(), said[id(p.truth)]) for p in pairs]
        distinct = sorted({pair for pair in asked if all(pair)})
        found = np.asarray(self.scorer.score(distinct), np.float64) if distinct else np.empty(0)
        votes = dict(zip(distinct, found.tolist(), strict=True))
        return np.array([votes.get(pair, np.nan) for pair in asked], np.float64)


def spoken(truth: NodeTruth) -> str:
    """The truth as one text: captions, then what is listed."""
    return " ".join(truth.texts)
