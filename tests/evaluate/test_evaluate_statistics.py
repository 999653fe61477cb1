"""Tests between systems: by hand, against scipy, and what must hold of any values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from erag.evaluate.statistics import (
    EXACT_UP_TO,
    Interval,
    bootstrap,
    clustered_bootstrap,
    compare,
    holm,
    paired_bootstrap,
    permutation_test,
)

values = st.lists(st.floats(0, 1), min_size=1, max_size=12)
p_values = st.dictionaries(st.sampled_from("abcdefgh"), st.floats(0, 1), max_size=8)


def test_three_queries_have_two_of_eight_signs_as_extreme() -> None:
    assert permutation_test([1.0, 1.0, 1.0], [0.0, 0.0, 0.0]) == 2 / 8
    assert permutation_test([1.0, 1.0, 0.0], [0.0, 0.0, 0.0]) == 2 / 4  # the tie says nothing
    assert permutation_test([1.0, 0.0], [0.0, 1.0]) == 1.0
    assert permutation_test([0.3, 0.4], [0.3, 0.4]) == 1.0


def test_the_exact_value_is_that_of_scipy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        a, b = rng.random(9), rng.random(9)
        theirs = stats.permutation_test(
            (a, b), lambda x, y: np.mean(x - y), permutation_type="samples", n_resamples=np.inf
        )
        assert permutation_test(a.tolist(), b.tolist()) == pytest.approx(theirs.pvalue)


def test_the_drawn_value_comes_near_the_t_test_and_repeats() -> None:
    rng = np.random.default_rng(3)
    a = rng.random(200)
    b = a - 0.02 + 0.2 * rng.standard_normal(200)
    p = permutation_test(a.tolist(), b.tolist(), samples=20_000)
    assert p == pytest.approx(stats.ttest_rel(a, b).pvalue, abs=0.01)
    assert p == permutation_test(a.tolist(), b.tolist(), samples=20_000)


def test_a_drawn_value_is_never_0() -> None:
    n = EXACT_UP_TO + 20
    assert permutation_test([1.0] * n, [0.0] * n, samples=99) == 1 / 100


def test_systems_of_one_distribution_are_told_apart_as_often_as_the_level_says() -> None:
    rng = np.random.default_rng(5)
    below = sum(permutation_test(rng.random(10).tolist(), rng.random(10).tolist()) < 0.05 for _ in range(300))
    assert 3 <= below <= 30  # 15 expected


def test_holm_by_hand() -> None:
    assert holm({"a": 0.01, "b": 0.04, "c": 0.03}) == pytest.approx({"a": 0.03, "b": 0.06, "c": 0.06})
    assert holm({"a": 0.5, "b": 0.9}) == {"a": 1.0, "b": 1.0}
    assert list(holm({"b": 0.5, "a": 0.1})) == ["b", "a"]
    assert holm({}) == {}
    with pytest.raises(ValueError, match=r"lie in \[0, 1\]"):
        holm({"a": 1.5})


@given(p_values)
def test_holm_lies_between_the_value_and_bonferroni_and_keeps_the_order(p: dict[str, float]) -> None:
    adjusted = holm(p)
    assert all(p[k] <= adjusted[k] <= min(1.0, len(p) * p[k]) for k in p)
    assert all(adjusted[a] <= adjusted[b] for a in p for b in p if p[a] <= p[b])


def test_groups_drawn_whole_make_a_wider_interval() -> None:
    """Two worlds, one always right and one always wrong: 40 queries, but two independent observations."""
    scores, worlds = [1.0] * 20 + [0.0] * 20, ["a"] * 20 + ["b"] * 20
    assert clustered_bootstrap(scores, worlds, confidence=0.9) == Interval(0.5, 0.0, 1.0)
    drawn = bootstrap(scores, confidence=0.9)
    assert 0.3 < drawn.low < drawn.high < 0.7
    with pytest.raises(ValueError, match="1 groups for 2 values"):
        clustered_bootstrap([0.0, 1.0], ["a"])


def test_groups_of_one_are_the_plain_bootstrap() -> None:
    scores = np.random.default_rng(1).random(30).tolist()
    assert clustered_bootstrap(scores, [f"{i:02d}" for i in range(30)]) == bootstrap(scores)


def test_pairs_tell_apart_what_means_do_not() -> None:
    """Queries differ much, the systems by .05 on each: the difference has no spread."""
    baseline = np.random.default_rng(2).random(50)
    interval = paired_bootstrap((baseline + 0.05).tolist(), baseline.tolist())
    assert (interval.low, interval.mean, interval.high) == pytest.approx((0.05, 0.05, 0.05))


def test_a_comparison_counts_and_corrects() -> None:
    scores = {
        "ours": [1.0, 1.0, 1.0, 0.5, 0.0],
        "flat": [0.0, 0.0, 0.0, 0.5, 0.5],
        "same": [0.0, 0.0, 0.0, 0.5, 0.5],
    }
    ours, same = compare("flat", scores)
    assert (ours.system, ours.baseline, ours.wins, ours.ties, ours.losses) == ("ours", "flat", 3, 1, 1)
    assert ours.difference.mean == pytest.approx(0.5)
    assert ours.p == 4 / 16  # |sum| of +-1 +-1 +-1 +-.5 is at least 2.5: all three alike, whatever the fourth is
    assert ours.adjusted == 0.5
    assert (same.p, same.adjusted, same.wins, same.ties) == (1.0, 1.0, 0, 5)
    assert "ours - flat: +0.500" in ours.line()
    with pytest.raises(KeyError):
        compare("none", scores)


def test_worlds_flip_together() -> None:
    """Two worlds of ten queries, one system better in both: 20 queries are sure, two worlds are not."""
    better, worse, worlds = [1.0] * 20, [0.5] * 20, ["a"] * 10 + ["b"] * 10
    assert permutation_test(better, worse) < 0.001
    assert permutation_test(better, worse, worlds) == 2 / 4
    assert permutation_test(better, worse, [f"{i}" for i in range(20)]) == permutation_test(better, worse)
    (told,) = compare("flat", {"ours": better, "flat": worse}, worlds)
    assert (told.p, told.difference.low, told.wins) == (0.5, 0.5, 20)
    mixed = paired_bootstrap([1.0] * 10 + [0.0] * 10, worse, worlds, confidence=0.9)
    assert (mixed.low, mixed.high) == (-0.5, 0.5)
    for test in (permutation_test, paired_bootstrap):
        with pytest.raises(ValueError, match="1 groups for 20 values"):
            test(better, worse, ["a"])


def test_other_queries_are_refused() -> None:
    for test in (permutation_test, paired_bootstrap):
        with pytest.raises(ValueError, match="not the same queries"):
            test([1.0, 0.0], [1.0])
        with pytest.raises(ValueError, match="finite"):
            test([float("nan")], [1.0])
    with pytest.raises(ValueError, match="samples 0"):
        permutation_test([1.0], [0.0], samples=0)


@given(values, st.floats(-1, 1))
def test_the_test_is_symmetric_and_blind_to_a_common_shift(a: list[float], shift: float) -> None:
    b = [x / 2 for x in a]
    p = permutation_test(a, b)
    assert 0 < p <= 1
    assert permutation_test(b, a) == p
    moved = permutation_test([4 * x for x in a], [4 * x for x in b])  # a power of two: no rounding
    assert moved == p
