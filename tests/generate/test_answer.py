"""Answers by code: where to go, the route, and quotes of what was seen."""

import pytest

from erag.core.types import Query, Route
from erag.generate.answer import NOTHING, Answerer, decide_kind
from erag.pipeline.session import Memory, open_memory


@pytest.fixture(scope="module")
def memory(campus, fake_config) -> Memory:  # type: ignore[no-untyped-def]
    return open_memory(campus, config=fake_config)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("Find a bench", "find"),
        ("Where is the pond?", "find"),
        ("I want to sit down", "find"),
        ("My tyre is flat", "find"),
        ("What is the vegetation like?", "explain"),
        ("Describe the campus", "explain"),
        ("Which trees stand here?", "explain"),
        ("What is near, and where can I sit?", "find"),
        (None, "find"),
    ],
)
def test_the_kind_of_a_question_that_does_not_say(text: str | None, kind: str) -> None:
    assert decide_kind(Query(text)) == kind
    assert decide_kind(Query(text, kind="explain")) == "explain"


def test_find_names_a_waypoint_of_the_map_and_quotes_its_description(memory: Memory) -> None:
    answer = memory.query("a fire hydrant", at=memory.map.nodes[0].pose.xyz, kind="find").answer
    assert answer is not None
    assert answer.waypoint is not None
    node = memory.map.nodes[memory.map.row[answer.waypoint.node]]
    assert answer.waypoint.position == node.pose.xyz
    quoted = answer.reason.split('"', 1)[1].rstrip('"')
    assert quoted in (node.caption or "") or quoted.rstrip(".") in (node.name or "")
    assert answer.route is not None
    assert answer.route.nodes[-1] == answer.waypoint.node
    assert answer.evidence == (answer.waypoint.node,)


def test_the_island_is_unreachable_and_said_so(memory: Memory) -> None:
    pose = memory.map.nodes[memory.map.row["n01"]].pose
    island = next(h for h in memory.query("priory court health centre", at=pose.xyz, top=62).hits if h.node == "p01")
    asker = memory.asker
    answer = Answerer(asker.corpus, asker._answerer._routes).answer(
        Query("x", pose, kind="find"), asker.corpus.node_vectors[0], [island]
    )
    assert answer.route == Route("unreachable")
    assert "no way there" in answer.text


def test_explain_quotes_each_view_with_its_id(memory: Memory) -> None:
    answer = memory.query("What grows here, grass or trees?", kind="explain").answer
    assert answer is not None
    assert answer.waypoint is None
    assert len(answer.evidence) == 5
    assert all(f"[{node}]" in answer.text for node in answer.evidence)
    assert "5 of 62 views" in answer.reason


def test_nothing_found_is_said_and_not_invented(memory: Memory) -> None:
    result = memory.query("a bench", since="2031")
    assert result.hits == ()
    assert result.answer is not None
    assert (result.answer.text, result.answer.waypoint) == (NOTHING, None)
