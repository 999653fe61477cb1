"""Judges over object lists: shown one by one, and our model of relevance."""

from __future__ import annotations

import math

import numpy as np

from erag.evaluate.judges.each import EachJudge
from erag.evaluate.judges.embedding import EmbeddingJudge
from erag.evaluate.judges.lexical import LexicalJudge
from erag.evaluate.judges.relevance import RelevanceJudge
from erag.evaluate.truth import Asked, NodeTruth, Pair, SeenObject, Truths
from erag.lm.fake import Fake

BENCH = NodeTruth("a", (SeenObject("bench", 0.05, "red"), SeenObject("tree", 0.3), SeenObject("bench", 0.02, "red")))
TREE = NodeTruth("b", (SeenObject("tree", 0.3), SeenObject("bench", 0.004)))  # a bench too small to be seen
EMPTY, TOLD = NodeTruth("c", ()), NodeTruth("d", captions=("A red bench by a path.",))
WORDS = LexicalJudge({"red": 1.0, "bench": 1.0, "tree": 1.0}, 1.0)


def votes(judge, text: str, *truths: NodeTruth) -> list[float]:
    return judge.probabilities([Pair(Asked("q", text), truth) for truth in truths]).tolist()


def test_the_best_object_counts_and_no_two_are_put_together() -> None:
    assert votes(EachJudge(WORDS), "a red tree", BENCH) == [0.5]
    assert votes(WORDS, "a red tree", BENCH) == [1.0]
    assert votes(EachJudge(WORDS), "a red bench", BENCH, TREE, EMPTY, TOLD) == [1.0, 0.0, 0.0, 1.0]


def test_classes_alone_have_no_looks() -> None:
    judge = EachJudge(WORDS, looks=False)
    assert votes(judge, "a red bench", BENCH, EMPTY) == [0.5, 0.0]
    assert math.isnan(votes(judge, "a red bench", TOLD)[0])


def test_no_object_and_no_pair() -> None:
    assert votes(EachJudge(WORDS), "a bench", EMPTY) == [0.0]
    assert EachJudge(WORDS).probabilities([]).shape == (0,)
    assert math.isnan(votes(EachJudge(WORDS), "where?", BENCH)[0])


def test_a_pair_does_not_affect_another() -> None:
    judge = EachJudge(EmbeddingJudge("e", Fake()))
    together = votes(judge, "a red bench", EMPTY, BENCH, TREE, TOLD)
    alone = [votes(judge, "a red bench", truth)[0] for truth in (EMPTY, BENCH, TREE, TOLD)]
    np.testing.assert_allclose(together, alone, atol=1e-6)


def test_relevance_finds_what_is_listed_and_abstains_on_what_is_not_known() -> None:
    judge = RelevanceJudge.over([BENCH, TREE, EMPTY], Fake())
    found = votes(judge, "Find a red bench.", BENCH, TREE, EMPTY)
    assert found[0] > found[1]
    assert all(0 <= p <= 1 for p in found[:2])
    assert math.isnan(found[2])
    assert math.isnan(votes(judge, " ", BENCH)[0])
    assert math.isnan(votes(RelevanceJudge.over([EMPTY], Fake()), "a bench", BENCH)[0])


def test_truths_of_some_nodes_without_captions_where_objects_are_listed() -> None:
    both = NodeTruth("e", (SeenObject("bench"),), captions=("A bench in the sun.",), place="park")
    truths = Truths({"d": TOLD, "e": both, "f": BENCH}, independent=False).over(["e", "d", "x"], listed=True)
    assert set(truths.by_node) == {"d", "e"}
    assert truths.of("e").texts == ("park, bench.",)
    assert truths.of("d").texts == ("A red bench by a path.",)
    assert not truths.independent
    np.testing.assert_array_equal(Truths({"e": both}).over(["e"]).of("e").captions, both.captions)
