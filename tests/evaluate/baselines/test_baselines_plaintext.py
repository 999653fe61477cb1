"""The map as plain text: lines, chunks, context, and which node an answer names."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.types import Edges, Frame, Interval, Observation, Pose, TopoMap
from erag.evaluate.baselines.plaintext import Chunk, ChunkIndex, chunks, named_node, node_line, question
from erag.forest.evidence import tokens
from erag.lm.fake import Fake

NOON = 1_745_496_000.0  # 24 April 2025, 12:00 UTC


def town(captions: list[str | None]) -> TopoMap:
    nodes = [Observation(f"n{i}", "place", Pose(i, 0.5), caption=c) for i, c in enumerate(captions)]
    return TopoMap(Frame.METRIC, tuple(nodes), Edges.empty())


def test_a_line_has_id_position_time_readings_and_caption() -> None:
    node = Observation("n1", "place", Pose(-79.9431, 40.4441), Interval(NOON, NOON), sensors={"ndvi": 0.25, "a": 1})
    line = node_line(node, "A bench.")
    assert line == "node n1: position (-79.9431, 40.4441, 0); time 2025-04-24T12:00:00Z; a 1; ndvi 0.25; A bench."
    assert node_line(Observation("n2", "place", Pose(0, 0)), "").endswith("(0, 0, 0); no caption")


def test_chunks_hold_whole_nodes_in_order() -> None:
    topomap = town(["A bench.", "A tree. " * 100, None, "A road."])
    made = chunks(topomap, 60)
    assert [c.nodes for c in made] == [("n0",), ("n1",), ("n2", "n3")]
    assert made[2].text.count("\n") == 1
    assert chunks(town([])) == []
    with pytest.raises(ValueError, match="chunks of 0 tokens"):
        chunks(topomap, 0)


@given(st.lists(st.text(alphabet="ab .", max_size=300), max_size=20), st.integers(1, 200))
def test_every_node_is_in_one_chunk_and_none_is_too_long(captions: list[str], size: int) -> None:
    topomap = town(list(captions))
    made = chunks(topomap, size)
    assert [n for c in made for n in c.nodes] == [n.id for n in topomap.nodes]
    assert all(sum(tokens(line) for line in c.text.split("\n")) <= size for c in made if len(c.nodes) > 1)


def test_location_and_sensors_go_into_the_question() -> None:
    assert question("Find a bench.") == "Find a bench."
    asked = question("Find a bench.", Pose(1.5, 2), {"ndvi": "low", "lux": (1, 20)})
    assert asked == (
        "Find a bench. I am at position (1.5, 2, 0); prefer what is near. "
        "Prefer places where lux is between 1 and 20. Prefer places where ndvi is low."
    )
    assert question("", Pose(1, 2)).startswith("I am at")


def test_the_context_is_filled_from_the_most_similar_on() -> None:
    made = [Chunk("a red bench", ("n0",)), Chunk("a blue tree", ("n1",)), Chunk("the bench", ("n2",))]
    index = ChunkIndex(made, Fake())
    first, second, third = index.context("bench")
    assert {first.nodes, second.nodes} == {("n2",), ("n0",)}
    assert third.nodes == ("n1",)
    budget = tokens(first.text) + tokens(second.text)
    assert index.context("bench", budget) == (first, second)
    assert index.context("bench", budget - 1) == (first,)
    assert index.context("bench", 1) == ()
    assert ChunkIndex([], Fake()).context("bench") == ()


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        ("n12", "n12"),
        (" n1 ", "n1"),
        ("Go to node n1, it has a bench; node n2 is farther.", "n1"),
        ("Between n2 and the road lies node n12.", "n12"),
        ('{"node": "n2", "reason": "n1 is far"}', "n2"),
        ("The best is n2.", "n2"),
        ("NODE: n2", "n2"),
        ("Either n1 or n2.", None),
        ("n123", None),
        ("node n1.5", None),
        ("I do not know.", None),
        ("", None),
        ("far", "far"),  # an id of the map that the context did not hold
    ],
)
def test_an_answer_names_a_node_or_nothing(answer: str, expected: str | None) -> None:
    assert named_node(answer, ["n1", "n2", "n12"], frozenset({"n1", "n2", "n12", "far"})) == expected


def test_ids_are_no_patterns() -> None:
    assert named_node("node a.b(c", ["a.b(c", "aXb(c"], frozenset()) == "a.b(c"
    assert named_node("node aXb", ["a.b"], frozenset()) is None


def test_the_whole_way_on_a_map() -> None:
    topomap = town(["A red bench.", "A blue tree.", "A road."])
    index = ChunkIndex(chunks(topomap, 1), Fake())
    context = index.context(question("Where is the blue tree?"), 10_000)
    held = [n for c in context for n in c.nodes]
    assert held[0] == "n1"
    assert named_node(f"node {held[0]}", held, frozenset(topomap.row)) == "n1"
    assert np.isfinite(Fake().embed([c.text for c in context], "document")).all()
