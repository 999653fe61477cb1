"""The scaling benchmark: towns without twins, balanced forests, what is counted, the table and the plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from erag.bench.balanced import balanced_forest, morton_order
from erag.bench.config import ScalingBench
from erag.bench.maps import LOOKS, THINGS, Asked, ground_phrases, questions, thing_phrases, town
from erag.bench.scaling import Row, columns, plotted, run
from erag.lm.fake import Fake
from erag.lm.weights import default_store

FAKE = {"backend": {"models": {"m": {"kind": "fake"}}, "roles": {"embed": "m"}}}
RETRIEVERS = {
    "flat": {"retriever": {"kind": "fusion"}},
    "tree": {"retriever": {"kind": "tree", "evidence": 0.5, "scores": {"kind": "fusion"}}},
    "descent": {"retriever": {"kind": "tree", "evidence": 0.0, "leaves": "best", "scores": {"kind": "node"}}},
}


def test_words_are_given_once() -> None:
    assert len(set(THINGS)) == len(THINGS)
    assert len(set(LOOKS)) == len(LOOKS)
    assert len(set(ground_phrases())) == len(ground_phrases())


def test_a_town_has_no_twins_and_comes_again_for_its_seed() -> None:
    made = town(5000, 0)
    assert (made.things == town(5000, 0).things).all()
    assert not (made.things == town(5000, 1).things).all()
    assert len(set(made.captions())) == 5000
    assert len(np.unique(made.positions, axis=0)) == 5000
    key = np.concatenate([np.sort(made.things, axis=1), made.grounds[:, None]], axis=1)
    assert len(np.unique(key, axis=0)) == 5000
    assert (made.things[:, 0] != made.things[:, 1]).all()


def test_places_stand_on_streets_and_share_the_things_of_their_quarter() -> None:
    made = town(5000, 0)
    assert (made.positions % 100 == 0).any(axis=1).all()
    things = made.things // len(LOOKS)
    near = np.hypot(*(made.positions - made.positions[0]).T) < 100
    assert len(np.unique(things[near])) / near.sum() < len(np.unique(things)) / 80


def test_captions_say_what_the_rows_say_and_vectors_are_means_of_phrases() -> None:
    made, fake = town(40, 3), Fake()
    things, grounds = (fake.embed(texts, "document") for texts in (thing_phrases(), ground_phrases()))
    nodes, spoken = made.vectors(things, grounds)
    for row, said in enumerate(made.captions()):
        a, b = (thing_phrases()[i] for i in made.things[row])
        assert a in said.lower()
        assert b in said.lower()
        assert said.lower().endswith(f" {ground_phrases()[made.grounds[row]]}.")
        total = things[made.things[row]].sum(0)
        assert spoken[2 * row] == pytest.approx(total / np.linalg.norm(total), abs=1e-5)
        assert spoken[2 * row + 1] == pytest.approx(grounds[made.grounds[row]], abs=1e-5)
    assert np.linalg.norm(nodes, axis=1) == pytest.approx(np.ones(40), abs=1e-5)


def test_questions_are_about_places_that_there_are() -> None:
    made = town(400, 0)
    for asked in questions(made, 12, 0):
        right = [row for row in range(400) if asked.right(made.things[row].tolist())]
        assert right
        assert all(f"{thing_phrases()[t]}" in asked.text for t in asked.things)
    assert not Asked("", (1, 2)).right([1, 3])


@pytest.mark.parametrize("nodes", [1, 2, 15, 17, 400])
def test_a_balanced_forest_holds_every_node_once_in_clusters_of_one_size(nodes: int) -> None:
    made = town(nodes, 0)
    vectors = np.random.default_rng(0).normal(size=(nodes, 8)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    forest = balanced_forest(made.topomap(), vectors)
    assert len(forest.roots) == 1
    counts = np.bincount(forest.level)
    assert counts[0] == nodes
    for level in range(1, len(counts)):
        sizes = [len(c.members) for c in forest.clusters if c.level == level]
        assert max(sizes) - min(sizes) <= 1
        assert sum(sizes) == counts[level - 1]
    for row, cluster in enumerate(forest.clusters, nodes):
        assert {forest.ids[i] for i in forest.children[row]} == set(cluster.members)
        below = [i for i in range(nodes) if cluster.id in forest.path(i)]
        mean = vectors[below].sum(0)
        assert forest.embeddings[row] == pytest.approx(mean / np.linalg.norm(mean), abs=1e-4)
        assert cluster.position[:2] == pytest.approx(made.positions[below].mean(0))


def test_neighbours_in_morton_order_are_near() -> None:
    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0)), -1).reshape(-1, 2)
    quads = grid[morton_order(grid)].reshape(4, 4, 2)
    assert (np.ptp(quads, axis=1) == 1).all()


def test_a_run_counts_vectors_and_opened_nodes(tmp_path: Path) -> None:
    config = ScalingBench.model_validate(
        {"kind": "scaling", "sizes": [60, 400], "built_up_to": 100, "queries": 4, "repeats": 1,
         "retrievers": RETRIEVERS, "pipeline": FAKE}
    )  # fmt: skip
    rows = list(run(config, default_store()))
    assert [(r.nodes, r.retriever, r.forest) for r in rows] == [
        (n, name, made) for n, made in ((60, "built"), (400, "balanced")) for name in RETRIEVERS
    ]
    by = {(r.nodes, r.retriever): r for r in rows}
    for nodes in (60, 400):
        assert by[nodes, "flat"].vectors == 3 * nodes
        assert by[nodes, "flat"].opened == 0
        assert by[nodes, "tree"].vectors > 3 * nodes
        assert by[nodes, "descent"].vectors < nodes
        assert by[nodes, "tree"].opened > 0
        assert by[nodes, "flat"].right >= 0.5
    # the root, 3 of the 6 below it, 3 below each of these
    assert by[400, "tree"].opened == 1 + 3 + 9
    assert all(0 < r.median <= r.p95 and r.peak_mb > 10 for r in rows)
    names, cells = columns(rows)
    assert all(len(line) == len(names) for line in cells)
    pytest.importorskip("matplotlib")
    assert plotted(rows, tmp_path / "new" / "plot.png")
    assert (tmp_path / "new" / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_by_hand() -> None:
    _, cells = columns([Row(3000, "flat", 9000.0, 12.5, 0.0125, 0.5, 0.75, 1.0, 1234.5, "built")])
    assert cells == [("3,000", "flat", "9,000", "12.5", "12.5", "500.0", "0.75", "1.0", "1,234", "built")]
