"""The search for close pairs of clusters: all of them and no others, also where memory is short."""

from __future__ import annotations

import numpy as np
import pytest
from forest_worlds import world
from hypothesis import given, settings
from hypothesis import strategies as st

from erag.core.types import Frame
from erag.forest import guess, search
from erag.forest.affinity import Affinity
from erag.forest.search import Edges, pairs_within, table

EVERYTHING = slice(None)


def between(rows: Affinity, label: np.ndarray) -> dict[tuple[int, int], float]:
    """Largest dissimilarity of each pair of clusters, from the whole matrix."""
    far = rows.block(EVERYTHING, EVERYTHING)
    groups = [np.flatnonzero(label == g) for g in range(label.max() + 1)]
    return {(a, b): far[np.ix_(groups[a], groups[b])].max() for b in range(len(groups)) for a in range(b)}


def found(edges: Edges) -> dict[tuple[int, int], float]:
    a, b, d = edges.arrays()
    out = {(int(x), int(y)): float(z) for x, y, z in zip(a, b, d, strict=True)}
    assert len(out) == len(d)
    return out


def some_labels(seed: int, n: int, clusters: int) -> np.ndarray:
    """Clusters of very different sizes, numbered without gaps."""
    weight = np.random.default_rng(seed).dirichlet(np.full(clusters, 0.3))
    drawn = np.random.default_rng(seed + 1).choice(clusters, n, p=weight)
    return np.unique(drawn, return_inverse=True)[1]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(2, 150),
    clusters=st.integers(1, 150),
    frame=st.sampled_from(list(Frame)),
    alpha=st.sampled_from([0.0, 0.6, 1.0]),
    share=st.floats(0, 1),
)
def test_all_close_pairs_of_clusters_and_no_others(
    seed: int, n: int, clusters: int, frame: Frame, alpha: float, share: float
) -> None:
    rows = world(seed, n, frame, alpha=alpha).rows
    label = some_labels(seed, n, clusters)
    truth = between(rows, label)
    height = float(np.quantile([*truth.values(), 0.5], share))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "BLOCK", 16)
        edges = pairs_within(table(rows, label), height, 10**6)
    assert edges.height == height
    assert found(edges) == {pair: d for pair, d in truth.items() if d <= height}


@pytest.mark.parametrize("limit", [40, 300, 2000])
def test_when_memory_is_short_the_closest_are_kept_and_the_height_says_how_far(limit: int) -> None:
    w = world(3, 120, textless=0.0)
    truth = between(w.rows, np.arange(120))
    edges = pairs_within(table(w.rows, np.arange(120)), 2.0, limit)
    assert edges.height < 2.0
    assert 0 < len(found(edges)) <= limit
    assert found(edges) == {pair: d for pair, d in truth.items() if d <= edges.height}


def test_a_guessed_height_finds_about_a_dozen_pairs_a_cluster() -> None:
    w = world(5, 3000)
    clusters = table(w.rows, np.arange(3000))
    height = guess.height_for(clusters, 1, 10**9)
    assert 4 < pairs_within(clusters, height, 10**9).seen / 3000 < 30
    small = table(w.rows.take(np.arange(20)), np.arange(20))
    assert guess.height_for(small, 1, 10**9) == float("inf")


def test_fewer_pairs_are_looked_for_close_to_the_goal_and_when_memory_is_short() -> None:
    w = world(5, 2000)
    clusters = table(w.rows, np.arange(2000))
    far = guess.height_for(clusters, 1, 10**9)
    assert guess.height_for(clusters, 1900, 10**9) < far
    assert guess.height_for(clusters, 1, 2000) < far
