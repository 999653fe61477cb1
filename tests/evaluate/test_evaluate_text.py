"""SS with its controls, and fact coverage."""

from __future__ import annotations

import numpy as np
import pytest

from erag.evaluate.text import GENERIC, Golden, GoldenFact, SemanticSimilarity, fact_coverage, golden_facts
from erag.lm.fake import Fake
from erag.lm.roles import TextKind, Vectors

GOLDEN = Golden("There are two benches under tall lime trees, and no bicycle racks.")


class Axes:
    """An embedder that puts given texts on given directions."""

    def __init__(self, **rows: tuple[float, float]) -> None:
        self._rows = {key.replace("_", " "): value for key, value in rows.items()}

    def embed(self, texts: list[str], kind: TextKind) -> Vectors:
        return np.array([self._rows.get(t, (0.0, 1.0)) for t in texts], np.float32)


def test_similarity_and_lift_by_hand() -> None:
    """The answer at 3-4-5 from the golden one: .8; generic text and question at right angles: 0, so the lift is .8."""
    ss = SemanticSimilarity("axes", Axes(gold=(1, 0), good=(0.8, 0.6)))
    score = ss.scores(["q"], ["good"], [Golden("gold")])[0]
    assert (score.ss, score.generic, score.echo) == pytest.approx((0.8, 0, 0))
    assert score.lift == pytest.approx(0.8)


def test_an_answer_no_better_than_the_controls_has_no_lift() -> None:
    ss = SemanticSimilarity("axes", Axes(gold=(1, 0), question=(0.8, 0.6), answer=(0.6, 0.8)))
    worse = ss.scores(["question"], ["answer"], [Golden("gold")])[0]
    assert worse.lift == pytest.approx((0.6 - 0.8) / 0.2)
    ss = SemanticSimilarity("axes", Axes(gold=(0, 1)))  # everything is the golden answer to this embedder
    assert ss.scores(["q"], ["a"], [Golden("gold")])[0].lift == 0


def test_no_answer_is_worth_nothing_and_the_golden_one_everything() -> None:
    ss = SemanticSimilarity("fake", Fake())
    nothing, itself = ss.scores(["what is there?"] * 2, [" ", GOLDEN.text], [GOLDEN] * 2)
    assert (nothing.ss, nothing.coverage, nothing.contradicted) == (0, 0, 0)
    assert itself.ss == pytest.approx(1)
    assert (itself.coverage, itself.contradicted, itself.lift) == (1, 0, pytest.approx(1))
    assert nothing.generic == itself.generic < 0.9
    assert itself.values()["fact_coverage_generic"] == 0
    assert ss.scores([], [], []) == []


def test_the_generic_answer_beats_itself_not() -> None:
    score = SemanticSimilarity("fake", Fake()).scores(["what?"], [GENERIC], [GOLDEN])[0]
    assert score.ss == pytest.approx(score.generic)
    assert score.lift <= 1e-9


def test_facts_are_phrases_and_denials() -> None:
    assert set(golden_facts(GOLDEN)) == {
        GoldenFact(("bench",)),
        GoldenFact(("tall", "lim", "tre")),
        GoldenFact(("bicycl", "rack"), absent=True),
    }


def test_stated_facts_take_the_place_of_those_read_off_the_text() -> None:
    assert golden_facts(Golden("Whatever it says.", ("a bench", "no racks"))) == (
        GoldenFact(("bench",)),
        GoldenFact(("rack",), absent=True),
    )


@pytest.mark.parametrize(
    ("answer", "stated", "contradicted"),
    [
        ("A bench stands there.", 1 / 3, 0),
        ("Lime trees, tall and old, and benches.", 2 / 3, 0),
        ("There are no bicycle racks.", 1 / 3, 0),
        ("There are bicycle racks.", 0, 1 / 3),
        ("There is no bench.", 0, 1 / 3),
        ("A road.", 0, 0),
        ("", 0, 0),
    ],
)
def test_coverage_knows_what_is_denied(answer: str, stated: float, contradicted: float) -> None:
    assert fact_coverage(answer, golden_facts(GOLDEN)) == pytest.approx((stated, contradicted))


def test_without_facts_nothing_is_covered() -> None:
    assert fact_coverage("A bench.", ()) == (0, 0)


def test_what_cannot_be_scored_is_refused() -> None:
    ss = SemanticSimilarity("fake", Fake())
    with pytest.raises(ValueError, match="golden answer is empty"):
        ss.scores(["q"], ["a"], [Golden(" ")])
    with pytest.raises(ValueError, match="1 questions, 2 answers"):
        ss.scores(["q"], ["a", "b"], [GOLDEN])
