"""Complete linkage: equal to scipy's full matrix, valid and deterministic where pairs tie, honest about its limits."""

from __future__ import annotations

import numpy as np
import pytest
from forest_worlds import (
    World,
    by_definition,
    canonical,
    condensed_by_definition,
    cut_heights,
    has_ties,
    scipy_labels,
    scipy_tree,
    to_frame,
    world,
)
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from erag.core.errors import ConfigError
from erag.core.types import Frame
from erag.forest import chain, search
from erag.forest.linkage import Goal, Limits, balanced_merges, complete_linkage, dense_tree

FRAMES = st.sampled_from(list(Frame))
FULL = Limits(dense=10**4)
PASSES = Limits(dense=2)  # every map of three rows or more is too large for the full matrix
FEW_PAIRS = Limits(dense=2, edges=60, passes=10_000)


def labels(w: World, height: float, limits: Limits) -> np.ndarray:
    made = complete_linkage(w.rows, Goal(height=height), limits)
    assert made.complete
    return made.tree.labels(made.merges)


@pytest.mark.parametrize("limits", [FULL, PASSES, FEW_PAIRS], ids=["full", "passes", "few pairs"])
@pytest.mark.parametrize("small", [1500, 0], ids=["components", "chains"])
@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(3, 90),
    frame=FRAMES,
    alpha=st.sampled_from([0.0, 0.3, 0.6, 1.0]),
    theta=st.sampled_from([30.0, 100.0, 400.0]),
)
def test_same_partition_as_scipy_at_every_cut(
    limits: Limits, small: int, seed: int, n: int, frame: Frame, alpha: float, theta: float
) -> None:
    w = world(seed, n, frame, alpha=alpha, theta=theta)
    assume(not has_ties(condensed_by_definition(w)))
    tree = scipy_tree(w)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chain, "SMALL_COMPONENT", small)
        patch.setattr(search, "BLOCK", 16)
        for height in cut_heights(tree):
            assert (labels(w, height, limits) == scipy_labels(tree, height)).all()


@pytest.mark.parametrize("frame", list(Frame))
def test_same_whole_tree_as_scipy_on_a_map_of_several_blocks(frame: Frame) -> None:
    w = world(7, 1100, frame)
    tree = scipy_tree(w)
    made = complete_linkage(w.rows, Goal(), PASSES)
    assert made.path == "sparse"
    assert made.passes > 2
    assert len(made.tree) == 1099
    assert np.allclose(made.tree.height, tree[:, 2], atol=1e-7)
    for rows in (2, 5, 40, 200, 700):
        height = (tree[-rows, 2] + tree[1 - rows, 2]) / 2  # between the last merge made and the next
        assert (made.tree.labels(1100 - rows) == scipy_labels(tree, height)).all()


def test_far_blocks_are_left_out_without_changing_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four towns far apart and cuts that no two towns can reach."""
    monkeypatch.setattr(search, "BLOCK", 32)
    looked_at = []
    close = search._close
    monkeypatch.setattr(search, "_close", lambda *args: looked_at.append(args[1:3]) or close(*args))
    parts = [world(s, 64) for s in range(4)]
    positions = np.concatenate([p.positions + np.array([20_000.0 * s, 0, 0]) for s, p in enumerate(parts)])
    w = World(Frame.METRIC, positions, np.concatenate([p.vectors for p in parts]))
    tree = scipy_tree(w)
    for height in (0.1, 0.25, 0.35):
        assert (labels(w, height, PASSES) == scipy_labels(tree, height)).all()
        assert len(looked_at) <= 4 * 3  # of 8 blocks: a town's two blocks with themselves and each other
        looked_at.clear()


@pytest.mark.parametrize("rows", [1, 2, 17, 60, 200])
def test_a_goal_of_rows_is_met_exactly(rows: int) -> None:
    w = world(3, 200)
    for limits in (FULL, PASSES):
        made = complete_linkage(w.rows, Goal(rows=rows), limits)
        assert made.tree.labels(made.merges).max() + 1 == rows


def test_a_map_moved_over_the_antimeridian_keeps_its_clusters() -> None:
    metres = world(5, 150).positions
    vectors = world(5, 150).vectors
    across = to_frame(metres, Frame.WGS84)
    away = across.copy()
    away[:, 0] = np.mod(across[:, 0], 360.0) - 90.0
    assert np.ptp(across[:, 0]) > 300
    for limits in (FULL, PASSES):
        made = [labels(World(Frame.WGS84, p, vectors), 0.5, limits) for p in (across, away)]
        assert (made[0] == made[1]).all()


def grid(side: int, textless: bool) -> World:
    """Places on a square grid that all look the same, or like nothing: nearly all pairs tie with others."""
    x, y = np.meshgrid(np.arange(side) * 10.0, np.arange(side) * 10.0)
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(side * side)], axis=1)
    vectors = np.zeros((side * side, 4), np.float32)
    vectors[:, 0] = not textless
    return World(Frame.METRIC, positions, vectors)


def doubled(seed: int) -> World:
    """A map in which every place occurs five times."""
    w = world(seed, 40)
    return World(w.frame, np.tile(w.positions, (5, 1)), np.tile(w.vectors, (5, 1)))


TIED = {"grid": grid(12, False), "textless grid": grid(12, True), "copies": doubled(1)}


@pytest.mark.parametrize("name", TIED)
@pytest.mark.parametrize("limits", [FULL, PASSES], ids=["full", "passes"])
@pytest.mark.parametrize("small", [1500, 0], ids=["components", "chains"])
@pytest.mark.parametrize("height", [0.001, 0.15, 0.4, 0.6])
def test_ties_give_a_valid_cut(name: str, limits: Limits, small: int, height: float, monkeypatch) -> None:
    monkeypatch.setattr(chain, "SMALL_COMPONENT", small)
    w, far = TIED[name], by_definition(TIED[name])
    label = labels(w, height, limits)
    groups = [np.flatnonzero(label == g) for g in range(label.max() + 1)]
    for i, a in enumerate(groups):
        assert far[np.ix_(a, a)].max() <= height + 1e-6
        for b in groups[i + 1 :]:
            assert far[np.ix_(a, b)].max() > height - 1e-6


@pytest.mark.parametrize("name", TIED)
def test_ties_give_the_same_tree_every_time(name: str) -> None:
    for limits in (FULL, PASSES):
        one, two = (complete_linkage(TIED[name].rows, Goal(), limits).tree for _ in range(2))
        assert (one.children == two.children).all()
        assert (one.height == two.height).all()


@pytest.mark.parametrize("limits", [FULL, PASSES], ids=["full", "passes"])
def test_coincident_places_split_into_even_parts(limits: Limits) -> None:
    w = World(Frame.METRIC, np.zeros((900, 3)), np.ones((900, 4), np.float32))
    tree = complete_linkage(w.rows, Goal(), limits).tree
    sizes = [len(g) for g in tree.groups(len(tree), 100)]
    assert sum(sizes) == 900
    assert max(sizes) <= 100
    assert np.mean(sizes) > 25


def test_more_ties_than_the_limit_holds_are_refused_by_name() -> None:
    """Forty words, all equally unlike each other, and far apart: no pair of them is closer than the others."""
    vectors = np.eye(40, dtype=np.float32)
    w = World(Frame.METRIC, np.arange(120.0).reshape(40, 3) * 1e6, vectors, theta=1.0)
    with pytest.raises(ConfigError, match="edge_limit"):
        complete_linkage(w.rows, Goal(), Limits(dense=2, edges=100))


def test_passes_that_run_out_are_admitted_and_what_they_made_is_valid() -> None:
    w = world(2, 400)
    made = complete_linkage(w.rows, Goal(), Limits(dense=2, edges=300, passes=3))
    assert not made.complete
    assert made.passes == 3
    assert 0 < len(made.tree) < 399
    tree = scipy_tree(w)
    assert np.allclose(made.tree.height, tree[: len(made.tree), 2], atol=1e-7)
    height = (tree[len(made.tree) - 1, 2] + tree[len(made.tree), 2]) / 2
    assert (made.tree.labels(made.merges) == scipy_labels(tree, height)).all()


@pytest.mark.parametrize("n", [0, 1, 2])
def test_the_smallest_maps(n: int) -> None:
    w = world(0, n, textless=0.0)
    tree = complete_linkage(w.rows, Goal(), FULL).tree
    assert len(tree) == max(0, n - 1)
    assert [list(g) for g in tree.groups(len(tree), 100)] == ([list(range(n))] if n else [])


def test_groups_above_the_largest_size_are_split_along_their_own_subtree() -> None:
    tree = dense_tree(world(4, 300).rows)
    whole = tree.groups(280, 10**6)
    split = tree.groups(280, 12)
    assert max(map(len, whole)) > 12 >= max(map(len, split))
    assert canonical(tree.labels(280)).max() + 1 == 20
    for part in split:
        assert sum(set(part) <= set(g) for g in whole) == 1
    assert sorted(np.concatenate(split)) == list(range(300))
    assert [g[0] for g in split] == sorted(g[0] for g in split)


@given(st.integers(1, 300))
def test_balanced_merges_join_a_group_once_and_flatly(n: int) -> None:
    merges = balanced_merges(list(range(n)))
    depth = np.zeros(n, int)
    for a, b in merges:
        depth[a] = max(depth[a], depth[b]) + 1
    assert len(merges) == n - 1
    assert depth[0] == int(np.ceil(np.log2(n)))
