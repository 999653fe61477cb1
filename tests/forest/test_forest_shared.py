"""Forests of real maps: sensible levels without language models, and the forests their authors made."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from erag.core.text import node_text, words
from erag.core.types import TopoMap
from erag.data.reading import Reading
from erag.data.registry import read
from erag.forest.build import build_forest
from erag.forest.config import ForestConfig
from erag.forest.given import given_forest
from erag.topomap.build import build_map
from erag.topomap.config import MapConfig

pytestmark = pytest.mark.shared


def load(source: Path) -> tuple[Reading, TopoMap, np.ndarray]:
    """A map and a vector a node: a sum of random directions of its words. Nearness of texts, and no model."""
    reading = read(source)
    topomap, _ = build_map(reading.frame, reading.observations, reading.edges, MapConfig())
    texts = [words(node_text(n.name, n.caption)) for n in topomap.nodes]
    known = {w: i for i, w in enumerate(sorted({w for text in texts for w in text}))}
    directions = np.random.default_rng(0).normal(size=(len(known), 128))
    vectors = [directions[sorted({known[w] for w in text})].sum(axis=0) for text in texts]
    return reading, topomap, np.array(vectors, np.float32)


def test_cmu_500_shrinks_level_by_level(shared: Path) -> None:
    _, topomap, vectors = load(shared / "data" / "cmu_500" / "topological_map.gml")
    forest, report = build_forest(topomap, vectors)
    first = report.levels[0]
    assert first.rows == 3313
    assert first.mean_size <= 25
    assert max(first.sizes) <= 100
    clusters = [level.clusters for level in report.levels]
    assert all(2 * above < below for below, above in pairwise(clusters) if below > 4)
    assert 1 <= report.roots <= 5
    assert 20 < first.theta < 80  # the authors set 50 m by hand
    extent = [c.mean_distance for c in forest.clusters if c.level == 1]
    assert np.median(extent) < first.theta


def test_cmu_500_is_the_same_in_passes(shared: Path) -> None:
    _, topomap, vectors = load(shared / "data" / "cmu_500" / "topological_map.gml")
    dense, _ = build_forest(topomap, vectors, ForestConfig(max_levels=2))
    sparse, report = build_forest(topomap, vectors, ForestConfig(max_levels=2, dense_limit=1000))
    assert report.levels[0].path == "sparse"
    assert dense.clusters == sparse.clusters


@pytest.mark.parametrize(("source", "most"), [("building99/semantic_forest_gpt.gml", 60), ("coex_1f", 8)])
def test_small_maps_end_in_few_roots(shared: Path, source: str, most: int) -> None:
    _, topomap, vectors = load(shared / "data" / source)
    _, report = build_forest(topomap, vectors)
    assert report.levels[0].clusters <= most
    assert report.levels[0].mean_size <= 25
    assert report.roots <= 3


def test_the_authors_forest_of_cmu_500(shared: Path) -> None:
    reading, topomap, vectors = load(shared / "data" / "cmu_500" / "semantic_forest_gpt4.gml")
    forest, issues = given_forest(topomap, reading.clusters, vectors)
    assert list(np.bincount(forest.level)) == [3313, 159, 45, 10, 2, 1]
    assert len(forest.roots) == 1
    assert issues == ()
