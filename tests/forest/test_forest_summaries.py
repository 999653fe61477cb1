"""Facts counted by code, and summaries that say nothing their members do not support."""

import numpy as np
import pytest

from erag.core.types import Cluster, Edges, Forest, Frame, Observation, Pose, TopoMap
from erag.forest.facts import cluster_facts
from erag.forest.summaries import SummaryConfig, summarise_forest
from erag.forest.support import Evidence, supported
from erag.forest.vocabulary import map_vocabulary
from erag.lm.ledger import Ledger
from erag.lm.roles import Group, Summary

PARK = (
    "A wooden bench stands under a tall oak tree. There are no pedestrians visible.",
    "Two benches face a pond, and an oak tree leans over the water.",
    'A gravel path leads past a bench and a sign that reads "Keep off the grass".',
)
STREET = (
    "Parked cars line a two-lane street with a crosswalk.",
    "A crosswalk leads over the street, and parked cars wait at a traffic light.",
    "A bus stops beside parked cars on a busy street.",
)


def world() -> tuple[TopoMap, Forest]:
    nodes = tuple(
        Observation(f"n{i}", "place", Pose(float(i * 5), 0.0), caption=text) for i, text in enumerate((*PARK, *STREET))
    )
    clusters = (
        Cluster("L1-0", 1, ("n0", "n1", "n2"), (5.0, 0.0, 0.0), 6.7),
        Cluster("L1-1", 1, ("n3", "n4", "n5"), (20.0, 0.0, 0.0), 6.7),
        Cluster("L2-0", 2, ("L1-0", "L1-1"), (12.5, 0.0, 0.0), 15.0),
    )
    parent = np.array([6, 6, 6, 7, 7, 7, 8, 8, -1])
    level = np.array([0] * 6 + [1, 1, 2])
    forest = Forest(tuple(n.id for n in nodes), clusters, parent, level, np.zeros((9, 4), np.float32))
    return TopoMap(Frame.METRIC, nodes, Edges.empty()), forest


class Liar:
    """Says one thing that is there and one that is not."""

    def __init__(self) -> None:
        self.groups: list[Group] = []

    def summarise(self, groups: list[Group]) -> list[Summary]:  # type: ignore[override]
        self.groups += groups
        text = "There is a bench near a tree. A helicopter lands on the volcano."
        return [Summary("Benches", text, ("bench under tree", "dragon above castle")) for _ in groups]


def test_facts_count_views_and_leave_out_what_is_denied() -> None:
    topomap, _ = world()
    facts = list(cluster_facts(map_vocabulary(topomap), np.array([0, 1, 2])))
    benches = [f for f in facts if "bench" in str(f.entry)]
    assert benches
    assert max(f.views for f in benches) == 3
    assert all(f.of == 3 for f in facts)
    assert not [f for f in facts if "pedestrian" in str(f.entry)]


def test_statements_without_support_are_told_apart() -> None:
    kept, removed = supported("A bench stands by an oak tree. A helicopter lands.", Evidence.of_texts(PARK))
    assert kept == ("A bench stands by an oak tree.",)
    assert removed == ("A helicopter lands.",)


def test_every_cluster_is_described_and_inventions_are_removed_and_counted() -> None:
    topomap, forest = world()
    liar, ledger = Liar(), Ledger()
    told = summarise_forest(topomap, forest, liar, SummaryConfig(again=None), ledger)
    assert all(c.name and c.summary for c in told.clusters)
    assert not any("helicopter" in c.summary or "volcano" in c.summary for c in told.clusters)
    assert not any("dragon" in r for c in told.clusters for r in c.relationships)
    assert sum(ledger.events.values()) > 0
    assert len(liar.groups) == 3
    assert all(g.facts for g in liar.groups)


@pytest.mark.parametrize("text", ["", "   "])
def test_a_summary_of_nothing_is_composed_from_the_facts(text: str) -> None:
    topomap, forest = world()

    class Empty(Liar):
        def summarise(self, groups: list[Group]) -> list[Summary]:  # type: ignore[override]
            return [Summary("", text) for _ in groups]

    told = summarise_forest(topomap, forest, Empty())
    assert all(c.name and c.summary for c in told.clusters)
    assert "bench in 3 of 3 views" in told.clusters[0].summary.lower()
