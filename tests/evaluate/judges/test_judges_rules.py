"""Judges without a language model: object lists, words, embeddings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from erag.evaluate.judges.embedding import EmbeddingJudge
from erag.evaluate.judges.labels import LabelJudge
from erag.evaluate.judges.lexical import LexicalJudge, question_words
from erag.evaluate.truth import Asked, NodeTruth, Pair, SeenObject
from erag.lm.fake import Fake
from erag.lm.roles import TextKind, Vectors

BENCH = NodeTruth("n1", (SeenObject("bench", 0.05), SeenObject("fire hydrant", 0.004), SeenObject("lamp post", 0.02)))
RACKS = NodeTruth("n2", (SeenObject("bicycle rack", 0.2), SeenObject("tool rack", 0.1)))
NOTHING, UNKNOWN = NodeTruth("n3", ()), NodeTruth("n4")
CLASSES = frozenset({"bench", "fire hydrant", "lamp post", "bicycle rack", "tool rack", "rack"})


def votes(judge, text: str, *truths: NodeTruth, targets: set[str] | None = None) -> list[float]:
    asked = Asked("q", text, None if targets is None else frozenset(targets))
    return judge.probabilities([Pair(asked, t) for t in truths]).tolist()


def test_what_is_named_and_seen_is_certain_and_what_is_small_less_so() -> None:
    judge = LabelJudge(CLASSES)
    assert votes(judge, "Find a bench to sit on.", BENCH, RACKS, NOTHING) == [1, 0, 0]
    assert votes(judge, "Where are Fire Hydrants?", BENCH) == [pytest.approx(0.4)]


def test_a_longer_name_beats_one_inside_it() -> None:
    assert votes(LabelJudge(CLASSES), "Show me bike racks.", RACKS, NodeTruth("n", (SeenObject("rack"),))) == [1, 0]


def test_stated_targets_count_and_words_do_not() -> None:
    judge = LabelJudge(CLASSES)
    assert votes(judge, "Somewhere to lock up my bike near a bench", BENCH, RACKS, targets={"Bicycle Racks"}) == [0, 1]
    assert math.isnan(votes(judge, "a bench", BENCH, targets=set())[0])


def test_the_label_judge_abstains_on_what_nobody_listed() -> None:
    judge = LabelJudge(CLASSES)
    assert math.isnan(votes(judge, "a bench", UNKNOWN)[0])
    assert math.isnan(votes(judge, "somewhere quiet", BENCH)[0])
    assert math.isnan(votes(LabelJudge.over(NOTHING.objects or ()), "a bench", BENCH)[0])


def test_question_words_are_what_is_asked_for() -> None:
    assert question_words("I want to find the bicycle racks, please.") == {"bicycl", "rack"}
    assert question_words("Take me there. Where is it?") == set()


CAPTIONS = [
    NodeTruth("a", captions=("A bench under a tree.",)),
    NodeTruth("b", captions=("A tree by the road. There is no bench.",)),
    NodeTruth("c", captions=("A road.",)),
]


def test_the_share_of_rare_words_by_hand() -> None:
    """`bench` is said by one of three, `tree` by two: weights log(1 + 2.5/1.5) and log(1 + 1.5/2.5)."""
    judge = LexicalJudge.over(CAPTIONS)
    bench, tree = math.log(1 + 2.5 / 1.5), math.log(1 + 1.5 / 2.5)
    found = votes(judge, "a bench beside a tree", *CAPTIONS)
    assert found == pytest.approx([1.0, tree / (bench + tree), 0.0])  # what is denied is not said


def test_words_of_no_caption_weigh_most() -> None:
    judge = LexicalJudge.over(CAPTIONS)
    assert votes(judge, "a zebra and a bench", CAPTIONS[0])[0] < 0.5
    assert votes(judge, "a zebra", CAPTIONS[0]) == [0.0]


def test_the_word_judge_reads_objects_too_and_abstains_without_words() -> None:
    judge = LexicalJudge.over([*CAPTIONS, BENCH])
    assert votes(judge, "a lamp post", BENCH) == [1.0]
    assert votes(judge, "a fire hydrant", BENCH) == [0.0]  # below 1 % of the image: not seen
    assert math.isnan(votes(judge, "a bench", UNKNOWN)[0])
    assert math.isnan(votes(judge, "where?", CAPTIONS[0])[0])


class Plane:
    """Questions on the x axis; sentences at the angle their number of words says, in tenths of a right angle."""

    def __init__(self) -> None:
        self.calls: list[list[str]] = []

    def embed(self, texts: list[str], kind: TextKind) -> Vectors:
        self.calls.append(list(texts))
        angle = [0.0 if kind == "query" else len(t.split()) * np.pi / 20 for t in texts]
        return np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(np.float32)


def test_the_best_sentence_counts() -> None:
    judge = EmbeddingJudge("plane", Plane())
    two = NodeTruth("n", captions=("One two three four five six. One two.", "One two three four."))
    far = NodeTruth("m", captions=("One two three four five six seven eight nine ten eleven twelve thirteen.",))
    found = votes(judge, "q", two, far, UNKNOWN)
    assert found[0] == pytest.approx(math.cos(2 * math.pi / 20), abs=1e-6)
    assert found[1] == 0  # an obtuse angle
    assert math.isnan(found[2])


def test_every_text_is_embedded_once() -> None:
    plane = Plane()
    judge = EmbeddingJudge("plane", plane)
    truths = [NodeTruth(str(i), captions=("A bench. A tree.",)) for i in range(4)]
    judge.probabilities([Pair(Asked("q", t), truth) for t in ("x", "y") for truth in truths])
    assert plane.calls == [["A bench.", "A tree."], ["x", "y"]]
    assert judge.probabilities([]).shape == (0,)
    assert math.isnan(votes(judge, " ", truths[0])[0])


def test_pairs_do_not_affect_each_other() -> None:
    truths = [*CAPTIONS, BENCH, RACKS, UNKNOWN]
    for judge in (LexicalJudge.over(truths), EmbeddingJudge("fake", Fake()), LabelJudge(CLASSES)):
        pairs = [Pair(Asked(t, t), truth) for t in ("a bench", "a tree", "bike racks") for truth in truths]
        together = judge.probabilities(pairs)
        alone = [float(judge.probabilities([p])[0]) for p in pairs]
        assert together == pytest.approx(alone, nan_ok=True, abs=1e-6)
        assert judge.probabilities(pairs[::-1]) == pytest.approx(together[::-1], nan_ok=True, abs=1e-6)
