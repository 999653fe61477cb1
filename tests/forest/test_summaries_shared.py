"""The metrics on the authors' summaries: they cover facts, and are mostly supported by their own clusters only."""

import random
from pathlib import Path

import numpy as np
import pytest

from erag.core.types import Edges, Forest, TopoMap
from erag.data.registry import read
from erag.forest.facts import cluster_facts
from erag.forest.given import given_forest
from erag.forest.quality import base_nodes, forest_quality
from erag.forest.support import Evidence, check
from erag.forest.vocabulary import Vocabulary, map_vocabulary
from erag.lm.roles import Summary

pytestmark = pytest.mark.shared
World = tuple[TopoMap, Forest, Vocabulary]


@pytest.fixture(scope="module")
def world(shared: Path) -> World:
    reading = read(shared / "data" / "cmu_500" / "semantic_forest_gpt4.gml")
    topomap = TopoMap(reading.frame, reading.observations, Edges.empty())
    forest, _ = given_forest(topomap, reading.clusters, np.zeros((len(topomap), 2), np.float32))
    return topomap, forest, map_vocabulary(topomap)


def test_the_authors_summaries_cover_facts_and_are_mostly_supported(world: World) -> None:
    quality = forest_quality(*world[:2])[1]
    assert quality.clusters == quality.described == 159
    assert quality.coverage > 0.55
    assert quality.unsupported_rate < 0.12


def test_a_summary_of_another_cluster_is_unsupported(world: World) -> None:
    _, forest, words = world
    first = [(c, rows) for c, rows in zip(forest.clusters, base_nodes(forest), strict=True) if c.level == 1]
    others = first[1:] + first[:1]
    removed = statements = 0
    for (cluster, _), (_, rows) in zip(first, others, strict=True):
        said = Summary(cluster.name, cluster.summary, cluster.relationships)
        checked = check(said, Evidence(words, rows, cluster_facts(words, rows)))
        removed, statements = removed + len(checked.removed), statements + checked.statements
    assert removed / statements > 0.4  # neighbouring clusters share much of what is said


def test_things_that_no_member_has_are_caught(world: World) -> None:
    _, forest, words = world
    rng, wrong, right = random.Random(0), [0, 0], [0, 0]
    things = [i for i, e in enumerate(words.entries) if e.kind in ("object", "place") and words.views[i] >= 10]
    for rows in base_nodes(forest)[:159]:
        here = words.having(rows, [words.entries[i] for i in things]).any(axis=0)
        evidence = Evidence(words, rows)
        for counts, there in ((wrong, False), (right, True)):
            pool = [i for i, h in zip(things, here, strict=True) if h == there]
            for i in rng.sample(pool, 4):
                counts[0] += evidence.supports(f"There is a {words.entries[i].shown}.")
                counts[1] += 1
    assert right[0] == right[1]
    assert wrong[0] / wrong[1] < 0.35  # of words that occur in one text, but not together, some pass
