"""Pairs with labels, from an environment and rankings."""

from __future__ import annotations

from pathlib import Path

from erag.data.contract import QueryLine
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.judges.pairs import answer_pairs, labelled_pairs
from erag.evaluate.truth import NodeTruth, SeenObject, Truths


def question(id_: str, text: str | None, relevant: set[str] | None) -> Question:
    raw = {"id": id_} if text is None else {"id": id_, "query": text}
    return Question(QueryLine(1, id_, raw), "explicit", None if relevant is None else frozenset(relevant))


TRUTHS = Truths({"a": NodeTruth("a", (SeenObject("bench"),)), "b": NodeTruth("b", ())})
ASKED = (
    question("1", "a bench", {"a"}),
    question("2", "x", None),
    question("3", "y", set()),
    question("4", None, {"b"}),
)
WORLD = Environment("w", Path("w"), ASKED, TRUTHS)


def test_labelled_questions_meet_every_node() -> None:
    found = labelled_pairs(WORLD, ["a", "b", "c"], {"1": ["b", "a"]})
    assert found.queries == ("1", "1", "1", "3", "3", "3")
    assert found.labels.tolist() == [True, False, False, False, False, False]
    assert found.places.tolist() == [2, 1, 4, 4, 4, 4]
    assert [p.truth.node for p in found.pairs[:3]] == ["a", "b", "c"]
    assert found.pairs[0].truth is TRUTHS.by_node["a"]
    assert found.pairs[2].truth == NodeTruth("c")


def test_answers_are_judged_in_their_order() -> None:
    pairs = answer_pairs(WORLD, ASKED[0], ["b", "a"])
    assert [(p.asked.text, p.truth.node) for p in pairs] == [("a bench", "b"), ("a bench", "a")]
    assert answer_pairs(WORLD, ASKED[0], []) == ()
    assert len(labelled_pairs(WORLD, [], {}).labels) == 0
