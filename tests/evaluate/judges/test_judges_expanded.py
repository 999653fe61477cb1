"""A judge that is asked by what would satisfy the question, too."""

from __future__ import annotations

import math

import numpy as np

from erag.evaluate.judges.expanded import ExpandedJudge
from erag.evaluate.judges.lexical import LexicalJudge
from erag.evaluate.truth import Asked, NodeTruth, Pair

TRUTHS = [NodeTruth("a", captions=("A café on a corner.",)), NodeTruth("b", captions=("A road.",)), NodeTruth("c")]
WORDS = LexicalJudge.over(TRUTHS)


def votes(judge: ExpandedJudge, *asked: Asked) -> list[float]:
    return judge.probabilities([Pair(a, t) for a in asked for t in TRUTHS]).tolist()


def test_the_best_version_counts() -> None:
    judge = ExpandedJudge(WORDS, {"q": ("a café", "a coffee machine")}, frozenset({"some model"}))
    first, second, nothing = votes(judge, Asked("q", "Where can I get caffeine?"))
    assert (first, second) == (1, 0)
    assert math.isnan(nothing)
    assert (judge.name, judge.models) == ("words, expanded", {"some model"})


def test_targets_expand_where_nothing_else_does() -> None:
    asked = Asked("q", "caffeine", frozenset({"café"}))
    assert votes(ExpandedJudge(WORDS), asked)[:2] == [1, 0]
    assert votes(ExpandedJudge(WORDS, {"q": ()}), asked)[:2] == [0, 0]


def test_without_expansions_it_is_the_judge_itself() -> None:
    asked = [Asked("1", "a café"), Asked("2", "a road"), Asked("3", "where?")]
    pairs = [Pair(a, t) for a in asked for t in TRUTHS]
    np.testing.assert_array_equal(ExpandedJudge(WORDS).probabilities(pairs), WORDS.probabilities(pairs))
    assert ExpandedJudge(WORDS).probabilities([]).shape == (0,)
