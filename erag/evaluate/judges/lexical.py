"""A judge that reads words: which of the question's words do the reference captions and object lists say?"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from erag.core.text import words
from erag.evaluate.judges.protocol import Floats
from erag.evaluate.truth import NodeTruth, Pair
from erag.forest.terms import content, fold, mentions, stem

# How people ask; none of these is what they ask for.
ASKING = frozenset(
    {"me", "want", "need", "wish", "like", "please", "somewhere", "someplace", "something", "anything", "i'd"}
)


@dataclass(frozen=True)
class LexicalJudge:
    """P = the share of the question's content words that the truth says, weighted by how rare they are there.

    `rarity` maps a stem to its weight, `unknown` is that of a word no truth says. What a caption denies (`no bench`) is
    not said. It abstains on a question without content words and on a truth without text.
    """

    rarity: Mapping[str, float]
    unknown: float
    name: str = "words"
    models: frozenset[str] = field(default=frozenset(), init=False)

    @classmethod
    def over(cls, truths: Iterable[NodeTruth]) -> LexicalJudge:
        """A judge with the rarities log(1 + (n − m + ½) / (m + ½)) of an environment, m of n nodes saying a word."""
        said = [_said(truth) for truth in truths]
        counts = Counter(word for one in said for word in one)
        return cls({word: _weight(len(said), m) for word, m in sorted(counts.items())}, _weight(len(said), 0))

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`."""
        asked = {text: question_words(text) for text in {p.asked.text for p in pairs}}
        said = {key: _said(truth) for key, truth in {id(p.truth): p.truth for p in pairs}.items()}
        return np.array([self._vote(asked[p.asked.text], said[id(p.truth)]) for p in pairs], np.float64)

    def _vote(self, asked: frozenset[str], said: frozenset[str]) -> float:
        if not asked or not said:
            return float("nan")
        weights = {word: self.rarity.get(word, self.unknown) for word in sorted(asked)}
        return sum(weight for word, weight in weights.items() if word in said) / sum(weights.values())


def question_words(text: str) -> frozenset[str]:
    """The stems of what a question asks for, without the words of asking."""
    return frozenset(stem(fold(w)) for w in words(text) if content(w) and w not in ASKING)


def _said(truth: NodeTruth) -> frozenset[str]:
    return frozenset(word for text in truth.texts for word in mentions(text).words)


def _weight(of: int, saying: int) -> float:
    return math.log(1 + (of - saying + 0.5) / (saying + 0.5))
