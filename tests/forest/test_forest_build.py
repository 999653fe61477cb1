"""Building a forest: what every forest obeys, size limits, carried rows, cuts, summaries, the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from forest_worlds import World, world
from hypothesis import given, settings
from hypothesis import strategies as st

from erag.core.errors import ConfigError, InputError
from erag.core.geometry import centroid, mean_pairwise_distance
from erag.core.types import NO_PARENT, Cluster, Edges, Forest, Frame, Observation, Pose, TopoMap
from erag.forest.affinity import auto_theta
from erag.forest.build import build_forest
from erag.forest.config import FixedCuts, ForestConfig, ShrinkCuts


def leaves_below(forest: Forest) -> list[list[int]]:
    below: list[list[int]] = [[i] for i in range(forest.n_leaves)] + [[] for _ in forest.clusters]
    for row, parent in enumerate(forest.parent):
        if parent != NO_PARENT:
            below[parent] += below[row]
    return [sorted(b) for b in below]


def assert_sound(forest: Forest, topomap: TopoMap, config: ForestConfig) -> None:
    row = {name: i for i, name in enumerate(forest.ids)}
    below = leaves_below(forest)
    assert len(row) == len(forest.ids)
    for number, cluster in enumerate(forest.clusters):
        at = forest.n_leaves + number
        members = [row[m] for m in cluster.members]
        assert config.min_size <= len(members) <= config.max_size
        assert sorted(members) == sorted(np.flatnonzero(forest.parent == at))
        assert all(forest.level[m] < cluster.level == forest.level[at] for m in members)
        assert cluster.position == centroid(topomap.frame, topomap.positions[below[at]])
        places = np.array([topomap.positions[m] if m < forest.n_leaves else position(forest, m) for m in members])
        assert cluster.mean_distance == pytest.approx(mean_pairwise_distance(topomap.frame, places))
    order = [(c.level, min(below[forest.n_leaves + i])) for i, c in enumerate(forest.clusters)]
    assert order == sorted(order)


def position(forest: Forest, row: int) -> tuple[float, float, float]:
    return forest.clusters[row - forest.n_leaves].position


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(0, 250),
    frame=st.sampled_from(list(Frame)),
    first=st.sampled_from([3.0, 16.0]),
    sizes=st.sampled_from([(2, 100), (2, 5), (4, 12)]),
    textless=st.sampled_from([0.0, 0.5, 1.0]),
    dense=st.sampled_from([2, 4000]),
)
def test_every_forest_is_sound(
    seed: int, n: int, frame: Frame, first: float, sizes: tuple[int, int], textless: float, dense: int
) -> None:
    w = world(seed, n, frame, textless=textless)
    config = ForestConfig(
        cuts=ShrinkCuts(first=first), min_size=sizes[0], max_size=sizes[1], dense_limit=dense, edge_limit=5000
    )
    forest, report = build_forest(w.topomap, w.vectors, config)
    assert_sound(forest, w.topomap, config)
    assert report.leaves == n
    assert report.roots == len(forest.roots)
    assert [r.clusters for r in report.levels] == list(np.bincount(forest.level)[1:])
    assert all(sum(r.sizes) + r.carried == r.rows for r in report.levels)


def test_building_twice_gives_the_same_forest_dense_or_not() -> None:
    w = world(11, 300)
    forests = [
        build_forest(w.topomap, w.vectors, ForestConfig(dense_limit=limit, edge_limit=pairs))[0]
        for limit, pairs in ((4000, 10**6), (4000, 10**6), (2, 10**6), (2, 600))
    ]
    for other in forests[1:]:
        assert (other.parent == forests[0].parent).all()
        assert other.clusters == forests[0].clusters
        assert (other.embeddings == forests[0].embeddings).all()


def test_levels_shrink_by_the_ratios_whatever_the_range_of_cosines() -> None:
    w = world(1, 640, textless=0.0)
    for pull in (0.0, 8.0):  # with a pull all cosines are above 0.9
        shifted = w.vectors + pull
        _, report = build_forest(w.topomap, shifted, ForestConfig(max_size=640, cuts=ShrinkCuts(floor=-1)))
        rows = [r.clusters + r.carried for r in report.levels]
        assert rows == [40, 9, 2, 1]


def test_theta_of_a_level_is_taken_from_its_own_rows_unless_it_is_given() -> None:
    w = world(1, 640, textless=0.0)
    forest, report = build_forest(w.topomap, w.vectors, ForestConfig(max_size=640))
    first, second = report.levels[:2]
    assert first.theta == auto_theta(w.frame, w.positions, 16)
    rows = [c.position for c in forest.clusters if c.level == 1]
    assert first.carried == 0
    assert second.theta == auto_theta(w.frame, np.array(rows), 4.5)
    _, fixed = build_forest(w.topomap, w.vectors, ForestConfig(theta=50))
    assert {level.theta for level in fixed.levels} == {50.0}


def test_clusters_are_numbered_by_their_smallest_leaf_and_avoid_ids_of_the_map() -> None:
    w = world(2, 64)
    forest, _ = build_forest(w.topomap, w.vectors, ForestConfig(cuts=ShrinkCuts(first=8)))
    assert [c.id for c in forest.clusters if c.level == 1] == [f"L1-{i}" for i in range(np.sum(forest.level == 1))]
    nodes = (replace(w.topomap.nodes[0], id="L1-0"), replace(w.topomap.nodes[1], id="_L1-0"), *w.topomap.nodes[2:])
    renamed, _ = build_forest(replace(w.topomap, nodes=nodes), w.vectors, ForestConfig(cuts=ShrinkCuts(first=8)))
    assert renamed.clusters[0].id == "__L1-0"
    assert (renamed.parent == forest.parent).all()


def two_towns_and_a_hermit() -> World:
    towns = [[x, y, 0] for x in (0, 1000) for y in range(0, 40, 10)]
    vectors = np.array([[1, 0]] * 4 + [[0.9, 0.1]] * 4 + [[-1, 0.2]], np.float32)
    return World(Frame.METRIC, np.array([*towns, [90_000, 0, 0]], float), vectors)


def test_what_joins_nothing_is_carried_up_and_ends_as_a_root() -> None:
    w = two_towns_and_a_hermit()
    forest, report = build_forest(w.topomap, w.vectors, ForestConfig(theta=50.0, cuts=ShrinkCuts(first=3, floor=0.1)))
    assert [c.members for c in forest.clusters] == [
        ("n0", "n1", "n2", "n3"),
        ("n4", "n5", "n6", "n7"),
        ("L1-0", "L1-1"),
    ]
    assert [forest.ids[r] for r in forest.roots] == ["n8", "L2-0"]
    assert [(r.carried, r.clusters) for r in report.levels] == [(1, 2), (1, 1)]
    assert report.roots == 2


def test_a_carried_row_may_join_later_and_skip_a_level() -> None:
    w = two_towns_and_a_hermit()
    forest, _ = build_forest(w.topomap, w.vectors, ForestConfig(theta=50.0, cuts=ShrinkCuts(first=3, floor=-1)))
    assert forest.level[forest.parent[8]] > 1
    assert len(forest.roots) == 1


def test_groups_below_the_smallest_size_are_no_clusters() -> None:
    w = world(6, 200)
    _, loose = build_forest(w.topomap, w.vectors, ForestConfig(cuts=ShrinkCuts(first=8)))
    forest, strict = build_forest(w.topomap, w.vectors, ForestConfig(cuts=ShrinkCuts(first=8), min_size=6))
    assert min(loose.levels[0].sizes) < 6 <= min(len(c.members) for c in forest.clusters)
    assert strict.levels[0].carried == loose.levels[0].carried + sum(s for s in loose.levels[0].sizes if s < 6)


def test_places_without_text_cluster_by_distance_alone() -> None:
    at = np.array([[x, y, 0] for x in (0, 500) for y in range(0, 50, 10)], float)
    w = World(Frame.METRIC, at, np.zeros((10, 4), np.float32))
    forest, _ = build_forest(w.topomap, w.vectors, ForestConfig(theta=50.0, cuts=ShrinkCuts(first=5)))
    assert [c.members for c in forest.clusters] == [tuple(f"n{i}" for i in range(s, s + 5)) for s in (0, 5)]
    assert not forest.embeddings.any()


def test_vectors_of_clusters_are_the_unit_means_of_base_nodes_with_text() -> None:
    w = world(8, 120, textless=0.3)
    forest, _ = build_forest(w.topomap, w.vectors)
    units = forest.embeddings[:120]
    assert (np.linalg.norm(units, axis=1) > 0).sum() == w.vectors.any(axis=1).sum()
    for row, below in list(enumerate(leaves_below(forest)))[120:]:
        mean = units[below].sum(axis=0)
        assert np.allclose(forest.embeddings[row], mean / np.linalg.norm(mean), atol=1e-6)
    assert forest.embeddings.dtype == np.float32


def test_sensors_are_means_over_the_base_nodes_that_have_a_reading() -> None:
    readings = [{"ndvi": 0.2}, {"ndvi": 0.6, "noise": 3.0}, {}, {}]
    nodes = [Observation(f"n{i}", "place", Pose(float(i), 0), sensors=s) for i, s in enumerate(readings)]
    topomap = TopoMap(Frame.METRIC, tuple(nodes), Edges.empty())
    forest, _ = build_forest(topomap, np.ones((4, 3)))
    assert forest.clusters[0].sensors == {"ndvi": pytest.approx(0.4), "noise": 3.0}
    bare = TopoMap(Frame.METRIC, tuple(nodes[2:]), Edges.empty())
    assert build_forest(bare, np.ones((2, 3)))[0].clusters[0].sensors == {}


def test_fixed_cuts_bound_every_level_and_an_empty_one_does_not_end_the_list() -> None:
    w = world(4, 200, textless=0.0)
    config = ForestConfig(theta=40.0, cuts=FixedCuts(heights=(0.0, 0.3, 0.6)))
    forest, report = build_forest(w.topomap, w.vectors, config)
    assert [r.level for r in report.levels] == [1, 2]
    assert [r.cut <= h for r, h in zip(report.levels, (0.3, 0.6), strict=True)] == [True, True]
    assert_sound(forest, w.topomap, config)


def test_the_authors_cuts_are_the_fixed_default() -> None:
    assert FixedCuts().heights == (0.40, 0.44, 0.48, 0.52, 0.56)


def test_levels_end_at_the_given_number() -> None:
    w = world(4, 200)
    _, report = build_forest(w.topomap, w.vectors, ForestConfig(max_levels=1))
    assert len(report.levels) == 1
    assert report.roots > 1


def test_summaries_stand_for_clusters_when_they_are_asked_for() -> None:
    w = world(12, 200, textless=0.0)
    seen: list[Cluster] = []

    def opposite(new: Sequence[Cluster]) -> np.ndarray:
        seen.extend(new)
        out = np.zeros((len(new), 16), np.float32)
        out[np.arange(len(new)), np.arange(len(new)) % 16] = -2.0
        return out

    config = ForestConfig(cluster_embedding="summary", cuts=ShrinkCuts(first=8))
    forest, _ = build_forest(w.topomap, w.vectors, config, summary_vectors=opposite)
    mean, _ = build_forest(w.topomap, w.vectors, ForestConfig(cuts=ShrinkCuts(first=8)))
    assert tuple(seen) == forest.clusters
    assert sorted(forest.embeddings[200].tolist()) == [-1.0] + [0.0] * 15
    assert [c.members for c in forest.clusters if c.level == 1] == [c.members for c in mean.clusters if c.level == 1]
    assert [c.members for c in forest.clusters if c.level == 2] != [c.members for c in mean.clusters if c.level == 2]


def test_settings_that_contradict_each_other_are_refused() -> None:
    w = world(0, 20)
    with pytest.raises(ConfigError, match="'summary' without"):
        build_forest(w.topomap, w.vectors, ForestConfig(cluster_embedding="summary"))
    with pytest.raises(ConfigError, match="'mean' with"):
        build_forest(w.topomap, w.vectors, ForestConfig(), summary_vectors=lambda new: np.zeros((len(new), 16)))
    with pytest.raises(InputError, match="19 vectors for 20 nodes"):
        build_forest(w.topomap, w.vectors[:19])
    with pytest.raises(InputError, match="summary vectors of shape"):
        build_forest(
            w.topomap,
            w.vectors,
            ForestConfig(cluster_embedding="summary"),
            summary_vectors=lambda new: np.zeros((len(new), 3)),
        )


@pytest.mark.parametrize(
    "bad",
    [
        {"alpha": 1.1},
        {"theta": 0},
        {"theta": "far"},
        {"min_size": 1},
        {"min_size": 9, "max_size": 8},
        {"cuts": {"kind": "shrink", "first": 1}},
        {"cuts": {"kind": "fixed", "heights": []}},
        {"cuts": {"kind": "guess"}},
        {"cuts": {"kind": ["shrink"]}},
        {"cuts": 3},
        {"alfa": 0.5},
    ],
)
def test_settings_out_of_range_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="validation error"):
        ForestConfig.model_validate(bad)


def test_a_config_loads_again_from_what_it_saves() -> None:
    for config in (ForestConfig(), ForestConfig(theta=50, cuts=FixedCuts()), ForestConfig(cuts=ShrinkCuts(first=20))):
        assert ForestConfig.model_validate_json(config.model_dump_json()) == config


def test_one_value_of_the_default_cuts_can_be_set_alone() -> None:
    assert ForestConfig.model_validate({"cuts": {"first": 24}}).cuts == ShrinkCuts(first=24)


def test_progress_is_told_on_large_maps() -> None:
    w = world(4, 200)
    told: list[tuple[str, int, int]] = []
    build_forest(w.topomap, w.vectors, ForestConfig(dense_limit=50), lambda *step: told.append(step))
    assert ("forest level 1", 1, 1) in told


def test_the_report_fits_a_terminal_and_says_what_was_done() -> None:
    w = world(21, 900)
    _, report = build_forest(w.topomap, w.vectors, ForestConfig(dense_limit=100, max_passes=2, edge_limit=300))
    lines = report.lines()
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith("nodes per level  900 · ")
    assert any("in 2 passes instead of a full matrix" in line for line in lines)
    assert any("max_passes 2 were used up" in line for line in lines)
    sizes = report.levels[0].sizes
    assert f" {sum(2 <= s <= 3 for s in sizes)}" in next(line for line in lines if "2–3" in line)


def test_the_report_of_a_map_without_clusters() -> None:
    w = world(0, 1)
    forest, report = build_forest(w.topomap, w.vectors)
    assert report.lines() == ["nodes per level  1", "roots 1   α 0.6   θ from the map"]
    assert forest.path(0) == ("n0",)
