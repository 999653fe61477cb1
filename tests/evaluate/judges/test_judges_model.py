"""A language model as a judge, and the stack that makes one probability of several judges."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from erag.core.errors import InputError
from erag.evaluate.judges.model import ModelJudge, spoken
from erag.evaluate.judges.protocol import Votes
from erag.evaluate.judges.stack import Stack, cross_stacked, fit_stack, read_stack
from erag.evaluate.truth import Asked, NodeTruth, Pair, SeenObject
from erag.lm.fake import Fake
from erag.lm.roles import Vectors

TRUTH = NodeTruth("n", (SeenObject("bench", 0.1),), ("A red bench.",), "park")


class Counting(Fake):
    """Counts the pairs it is asked."""

    asked = 0

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        self.asked += len(pairs)
        return super().score(pairs)


def test_it_reads_the_truth_alone_and_each_pair_once() -> None:
    model = Counting()
    judge = ModelJudge("fake", model, frozenset({"fake"}))
    pair, empty, unasked = Pair(Asked("q", "red bench"), TRUTH), NodeTruth("m"), Pair(Asked("w", " "), TRUTH)
    votes = judge.probabilities([pair, pair, Pair(Asked("q", "red bench"), empty), unasked])
    assert votes[:2].tolist() == [1.0, 1.0]
    assert np.isnan(votes[2:]).all()
    assert model.asked == 1
    assert spoken(TRUTH) == "A red bench. park, bench."
    assert judge.probabilities([]).shape == (0,)


def votes(*columns: Sequence[float]) -> Votes:
    names = tuple("abc"[: len(columns)])
    return Votes(names, tuple(frozenset() for _ in names), np.array(columns, np.float64).T)


def test_a_stack_listens_to_the_judge_that_knows() -> None:
    rng = np.random.default_rng(0)
    labels = rng.random(400) < 0.4
    knows = np.clip(np.where(labels, 0.7, 0.3) + rng.normal(0, 0.15, 400), 0, 1)
    noise, against = rng.random(400), 1 - knows
    made = fit_stack(votes(knows, noise, against), labels, ("a", "b", "c"))
    assert made.weights[0] > 10 * made.weights[1]
    assert made.weights[2] == 0  # no judge counts against itself
    p = made.probabilities(votes(knows, noise, against))
    assert abs(float(p.mean()) - float(labels.mean())) < 0.03  # calibrated
    assert float(p[labels].mean()) > 0.7 > 0.25 > float(p[~labels].mean())


def test_an_abstention_adds_nothing_and_a_missing_judge_is_told() -> None:
    labels = np.array([True, False, True, False])
    made = fit_stack(votes([0.9, 0.1, 0.8, 0.3], [0.6, 0.5, np.nan, np.nan]), labels, ("a", "b"))
    p = made.probabilities(votes([0.9, np.nan, np.nan], [np.nan, 0.5, np.nan]))
    assert np.isnan(p).tolist() == [False, False, True]
    assert 0 <= p[1] <= 1
    with pytest.raises(InputError, match="no judge 'b'"):
        made.probabilities(votes([0.9]))
    with pytest.raises(InputError, match="4 of 4 pairs are right"):
        fit_stack(votes([0.9, 0.1, 0.8, 0.3]), np.ones(4, np.bool_), ("a",))


def test_every_query_weighs_the_same() -> None:
    many, few = [0.9] * 90 + [0.1] * 2, [True] * 90 + [True] * 1 + [False] * 1
    x = votes([*many])
    groups = ["q1"] * 90 + ["q2"] * 2
    loud, fair = fit_stack(x, np.array(few), ("a",)), fit_stack(x, np.array(few), ("a",), groups)
    assert fair.probabilities(votes([0.1]))[0] < loud.probabilities(votes([0.1]))[0]


def test_it_is_tried_on_questions_it_was_not_fitted_on() -> None:
    groups = [f"q{i // 4}" for i in range(40)]
    labels = np.array([i % 2 == 0 for i in range(40)])
    x = votes([0.8 if label else 0.2 for label in labels])
    p = cross_stacked(x, labels, ("a",), groups)
    assert ((p > 0.5) == labels).all()
    with pytest.raises(InputError, match="1 groups"):
        cross_stacked(x, labels, ("a",), ["q"] * 40)


def test_a_stack_is_kept_as_json(tmp_path: Path) -> None:
    made = fit_stack(votes([0.9, 0.1]), np.array([True, False]), ("a",), fitted_on="worlds for training")
    made.save(tmp_path / "stack.json")
    assert read_stack(tmp_path / "stack.json") == made
    (tmp_path / "bad.json").write_text(
        '{"judges": ["a"], "weights": [], "means": [0], "deviations": [1], "intercept": 0}'
    )
    for name in ("bad.json", "none.json"):
        with pytest.raises(InputError, match="no stack"):
            read_stack(tmp_path / name)
    with pytest.raises(ValueError, match="above 0"):
        Stack(judges=("a",), weights=(1.0,), means=(0.0,), deviations=(0.0,), intercept=0.0)
