"""Tables of answers made by hand, with figures worked out by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from erag.core.errors import InputError
from erag.evaluate.statistics import holm
from erag.experiment.config import ColumnConfig, TableConfig
from erag.experiment.judging import TextScored, Voted
from erag.experiment.predictions import (
    Appender,
    Place,
    Prediction,
    line_of,
    read_predictions,
    write_records,
)
from erag.experiment.questions import QuestionRecord
from erag.experiment.scoring import mean_vote, scored, stacked
from erag.experiment.tables import Cell, Choices, compared, table

# R = 100 m. Of question q1 nodes a and b are right, of q2 node c, of q3 nothing is known and L is on the answer.
QUESTIONS = [
    QuestionRecord(data="d", environment="w", id="q1", kind="explicit", sets=("s",), at=(0, 0, 0), radius_m=100,
                   shortest_m=10, nearest_m=5, relevant=2),
    QuestionRecord(data="d", environment="w", id="q2", kind="explicit", sets=("s",), at=(0, 0, 0), radius_m=100,
                   shortest_m=50, nearest_m=5, relevant=1),
]  # fmt: skip
P, SECONDS, METRES = (ColumnConfig(title=m, set="s", metric=m) for m in ("p_q_a@1", "seconds", "metres@1"))
VOTES = [
    Voted(data="d", environment="w", id="q1", node="a", votes={"x": 1.0, "y": 0.6}, stack=0.9, relevant=True),
    Voted(data="d", environment="w", id="q1", node="b", votes={"x": 0.4}, stack=0.2, relevant=True),
    Voted(data="d", environment="w", id="q1", node="z", votes={"x": 0.0, "y": 0.2}, stack=0.1, relevant=False),
    Voted(data="d", environment="w", id="q2", node="c", votes={"x": 0.5, "y": 0.5}, stack=0.5, relevant=True),
]


def said(system: str, question: str, *hits: tuple[str, float], **more: object) -> Prediction:
    places = tuple(Place(node=node, metres=metres, on_edges=True) for node, metres in hits)
    base = {"system": system, "data": "d", "environment": "w", "id": question, "mode": "Q", "hits": places}
    return Prediction.model_validate(base | more)


def values(*predictions: Prediction, questions: list[QuestionRecord] = QUESTIONS) -> list[dict[str, float]]:
    return [dict(s.values) for s in scored(predictions, questions, VOTES, (), mean_vote())]


def test_scores_by_hand() -> None:
    (got,) = values(said("s", "q1", ("a", 20), ("z", 40), ("b", 200)))
    # P: a (1 + .6) / 2 = .8, z .1, b .4; NI .8, .6, 0 (farther than R)
    assert got["p_q_a@1"] == pytest.approx(0.8)
    assert got["p_q_a@5"] == pytest.approx((0.8 + 0.1 + 0.4) / 5)
    assert got["ni@1"] == pytest.approx(0.8)
    assert got["p_q_a_l@1"] == pytest.approx(0.64)
    assert got["p_q_a_l@5"] == pytest.approx((0.64 + 0.06 + 0) / 5)
    assert got["p_q_a_l_printed@1"] == pytest.approx(0.16)
    assert got["spl@1"] == pytest.approx(0.8 * 10 / 20)
    assert (got["precision@1"], got["precision@5"], got["mrr"]) == (1, pytest.approx(2 / 5), 1)
    assert got["map"] == pytest.approx((1 + 2 / 3) / 2)
    assert got["nearest@1"] == 0
    assert got["precision_ni@1"] == got["ni@1"] == pytest.approx(0.8)


def test_no_answer_a_refusal_and_an_error_count_zero() -> None:
    none = said("s", "q1")
    refused = said("s", "q1", ("a", 20), refused=True)
    failed = said("s", "q1", ("a", 20), error="the model said nothing")
    for got in values(none, refused, failed):
        assert (got["p_q_a@1"], got["p_q_a@5"], got["p_q_a_l@1"], got["precision@1"], got["mrr"]) == (0, 0, 0, 0, 0)
        assert "metres@1" not in got
    assert [got["refused"] for got in values(none, refused, failed)] == [0, 1, 0]


def test_a_node_answered_twice_counts_once() -> None:
    (got,) = values(said("s", "q1", ("a", 20), ("a", 20)))
    assert got["p_q_a@5"] == pytest.approx(0.8 / 5)
    assert got["precision@5"] == pytest.approx(1 / 5)


def test_a_map_without_extent() -> None:
    here = QUESTIONS[1].model_copy(update={"radius_m": 0.0, "shortest_m": 0.0})
    (got,) = values(said("s", "q2", ("c", 0)), questions=[here])
    assert (got["ni@1"], got["p_q_a_l@1"], got["p_q_a_l_printed@1"]) == (1, 0.5, 0)


def test_a_question_that_nothing_answers_has_no_label_scores_and_one_without_text_no_votes() -> None:
    nothing = QUESTIONS[0].model_copy(update={"relevant": 0})
    (got,) = values(said("s", "q1", ("a", 20)), questions=[nothing])
    assert "precision@1" not in got
    assert got["p_q_a@1"] == pytest.approx(0.8)
    wordless = QUESTIONS[0].model_copy(update={"worded": False})
    (got,) = values(said("s", "q1", ("a", 20)), questions=[wordless])
    assert "p_q_a@1" not in got
    assert got["precision@1"] == 1


def test_an_answer_nobody_voted_on_is_an_error() -> None:
    with pytest.raises(InputError, match="'c' was answered and not judged"):
        values(said("s", "q1", ("c", 20)))
    with pytest.raises(InputError, match="nobody voted on 'b'"):
        scored([said("s", "q1", ("b", 20))], QUESTIONS, VOTES, (), mean_vote(frozenset({"x"})))


def test_other_judges_and_the_stack_give_other_probabilities() -> None:
    (got,) = scored([said("s", "q1", ("a", 20))], QUESTIONS, VOTES, (), mean_vote(frozenset({"x"})))
    assert got.values["p_q_a@1"] == pytest.approx(0.6)
    (got,) = scored([said("s", "q1", ("a", 20))], QUESTIONS, VOTES, (), stacked)
    assert got.values["p_q_a@1"] == pytest.approx(0.9)


def test_texts_are_scored_as_texts() -> None:
    one = said("s", "q1", ("a", 20), kind="explain")
    text = TextScored(system="s", data="d", environment="w", id="q1", mode="Q", values={"ss": 0.5})
    (got,) = scored([one], QUESTIONS, VOTES, [text], mean_vote())
    assert got.values["ss"] == 0.5
    assert "p_q_a@1" not in got.values


def test_a_table_by_hand() -> None:
    config = TableConfig(
        title="T",
        columns=(
            ColumnConfig(title="P", set="s", metric="p_q_a@1", printed={"Paper": 0.55}),
            ColumnConfig(title="L", set="s", metric="p_q_a_l@1", mode="Q,L"),
        ),
    )
    predictions = [
        said("ours", "q1", ("a", 20)), said("ours", "q2", ("c", 50)), said("flat", "q1", ("z", 20)),
        said("flat", "q2", ("c", 50)), said("half", "q2", ("c", 50)),
    ]  # fmt: skip
    scores = scored(predictions, QUESTIONS, VOTES, (), mean_vote())
    made = table(config, "d", scores, Choices(("ours", "flat", "half"), frozenset({"flat"})))
    assert list(made.rows) == ["Paper (paper)", "ours", "flat", "half"]
    assert made.rows["Paper (paper)"] == (Cell(0.55), None)
    ours, flat, half = (made.rows[name][0] or Cell(-1) for name in ("ours", "flat", "half"))
    assert (ours.value, ours.n) == (pytest.approx((0.8 + 0.5) / 2), 2)
    assert (flat.value, flat.n) == (pytest.approx((0.1 + 0.5) / 2), 2)
    assert (half.value, half.n) == (0.5, 1)
    assert made.rows["ours"][1] is None
    assert table(config, "other", scores, Choices(("ours",), frozenset())).rows == {"Paper (paper)": (Cell(0.55), None)}


def test_every_system_is_tested_on_the_questions_it_shares_with_the_best_flat_one() -> None:
    keys = [("d", "w", f"q{i}") for i in range(4)]
    column = {
        "bad": dict.fromkeys(keys, 0.0),
        "good": dict(zip(keys, (0.5, 0.5, 0.5, 0.5), strict=True)),
        "ours": dict(zip(keys, (1.0, 1.0, 1.0, 0.5), strict=True)),
        "few": {keys[0]: 0.0, keys[1]: 0.5},
    }
    made = {c.system: c for c in compared(column, P, Choices(tuple(column), frozenset({"bad", "good"})))}
    assert {c.baseline for c in made.values()} == {"good"}
    ours, few, bad = made["ours"], made["few"], made["bad"]
    assert (ours.wins, ours.ties, ours.losses) == (3, 1, 0)
    assert ours.difference.mean == pytest.approx(1.5 / 4)
    assert ours.p == 2 / 8  # of the 8 signs of three equal differences two are as extreme
    assert (few.wins, few.ties, few.losses, few.p) == (0, 1, 1, 1.0)
    assert bad.p == 2 / 16
    adjusted = holm({"bad": 2 / 16, "ours": 2 / 8, "few": 1.0})
    assert {n: c.adjusted for n, c in made.items()} == adjusted
    fewer = compared({n: dict.fromkeys(keys, float(i)) for i, n in enumerate(column)}, SECONDS,
                     Choices(tuple(column), frozenset({"bad", "good"})))  # fmt: skip
    assert {c.baseline for c in fewer} == {"bad"}  # of seconds less is better
    assert compared(column, METRES, Choices(tuple(column), frozenset({"good"}))) == ()
    assert compared(column, P, Choices(tuple(column), frozenset())) == ()


def test_a_line_cut_by_a_kill_is_left_out_and_any_other_fault_is_told(tmp_path: Path) -> None:
    path = tmp_path / "predictions.jsonl"
    assert read_predictions(path) == []
    one, other = said("s", "q1", ("a", 20.123456789)), said("s", "q2", text="Schön | “x”")
    with Appender(path) as file:
        file.add(one)
        file.add(other)
    first, second = read_predictions(path)
    assert first.hits[0].metres == 20.12346
    assert second == other
    whole = path.read_text()
    path.write_text(whole + line_of(one)[:20])
    assert len(read_predictions(path)) == 2
    path.write_text(whole[:20] + "\n" + whole)
    with pytest.raises(InputError, match="line 1"):
        read_predictions(path)
    write_records(path, [one, one])
    with pytest.raises(InputError, match="is there twice"):
        read_predictions(path)
