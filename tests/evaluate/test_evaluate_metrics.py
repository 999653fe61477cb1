"""Metrics on examples worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from erag.evaluate.metrics import Interval, bootstrap, mean, mrr, precision_at, reciprocal_rank, success_at

RELEVANT = {"a", "b", "c"}


@pytest.mark.parametrize(
    ("hits", "k", "expected"),
    [
        (["a", "x", "b", "y", "z"], 1, 1.0),
        (["a", "x", "b", "y", "z"], 5, 2 / 5),
        (["x", "a"], 1, 0.0),
        (["a", "b"], 5, 2 / 5),  # three places are empty, and count
        ([], 1, 0.0),
        ([], 5, 0.0),
        (["a", "a", "a"], 3, 1 / 3),  # the same node thrice is one answer
        (["a", "a", "b"], 2, 1 / 2),
    ],
)
def test_precision_is_a_share_of_k_places(hits: list[str], k: int, expected: float) -> None:
    assert precision_at(hits, RELEVANT, k) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("hits", "k", "expected"), [(["x", "a"], 2, 1.0), (["x", "a"], 1, 0.0), ([], 3, 0.0), (["a", "a"], 2, 1.0)]
)
def test_success_is_any_relevant_hit(hits: list[str], k: int, expected: float) -> None:
    assert success_at(hits, RELEVANT, k) == expected


@pytest.mark.parametrize(
    ("hits", "expected"),
    [(["a"], 1.0), (["x", "y", "c", "a"], 1 / 3), (["x", "x", "b"], 1 / 3), (["x"], 0.0), ([], 0.0)],
)
def test_reciprocal_rank_is_that_of_the_first_relevant_hit(hits: list[str], expected: float) -> None:
    assert reciprocal_rank(hits, RELEVANT) == pytest.approx(expected)


def test_mrr_is_the_mean_over_queries() -> None:
    assert mrr([["a"], ["x", "b"], []], [RELEVANT, {"b"}, {"q"}]) == pytest.approx((1 + 1 / 2 + 0) / 3)
    with pytest.raises(ValueError, match="shorter"):
        mrr([["a"], ["b"]], [RELEVANT])


@pytest.mark.parametrize("relevant", [set(), [], "abc"])
def test_a_query_without_relevant_nodes_is_an_error_and_not_a_number(relevant: set[str]) -> None:
    for call in (lambda: precision_at(["a"], relevant, 1), lambda: success_at(["a"], relevant, 1)):
        with pytest.raises(ValueError, match="relevant nodes"):
            call()
    with pytest.raises(ValueError, match="relevant nodes"):
        reciprocal_rank(["a"], relevant)


def test_k_starts_at_one() -> None:
    with pytest.raises(ValueError, match="k must be at least 1, got 0"):
        precision_at(["a"], RELEVANT, 0)


def test_means_of_nothing_or_of_no_number_are_errors() -> None:
    assert mean([0.0, 1.0, 1.0]) == pytest.approx(2 / 3)
    for values in ([], [float("nan")], [1.0, float("inf")]):
        with pytest.raises(ValueError, match="finite values"):
            mean(values)
        with pytest.raises(ValueError, match="finite values"):
            bootstrap(values)


def test_the_interval_of_a_constant_is_a_point() -> None:
    assert bootstrap([0.5] * 7) == Interval(0.5, 0.5, 0.5)


def test_the_interval_holds_the_mean_and_repeats_with_its_seed() -> None:
    values = [1.0] * 20 + [0.0] * 5
    interval = bootstrap(values, seed=3)
    assert interval == bootstrap(values, seed=3)
    assert interval != bootstrap(values, seed=4, samples=50)
    assert interval.low < interval.mean == 0.8 < interval.high
    narrow = bootstrap(values, confidence=0.5, seed=3)
    assert interval.low <= narrow.low < narrow.high <= interval.high


def test_the_interval_comes_near_the_normal_one_on_many_queries() -> None:
    values = np.random.default_rng(0).random(1000)
    interval = bootstrap(values.tolist())
    half = 1.96 * values.std() / np.sqrt(len(values))
    assert (interval.low, interval.high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.003)


def test_two_queries_have_the_quartiles_of_their_four_draws() -> None:
    """Means of two draws from {0, 1} are 0, 1/2, 1/2, 1 with equal chance."""
    assert bootstrap([0.0, 1.0], confidence=0.4, samples=4000) == Interval(0.5, 0.5, 0.5)
    assert bootstrap([0.0, 1.0], confidence=0.9, samples=4000) == Interval(0.5, 0.0, 1.0)


@pytest.mark.parametrize("wrong", [{"confidence": 0.0}, {"confidence": 1.0}, {"samples": 0}])
def test_wrong_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must lie in"):
        bootstrap([1.0], **wrong)  # type: ignore[arg-type]


def test_an_interval_reads_as_mean_and_bounds() -> None:
    assert str(Interval(0.8, 0.64, 0.925)) == "0.80 [0.64, 0.93]"
