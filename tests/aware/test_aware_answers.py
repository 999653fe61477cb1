"""Questions about sensors, times, changes and numbers asked of a built memory, without weights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from aware_worlds import twice

from erag.core.types import Answer, EdgeKind, Frame
from erag.data.contract import Result
from erag.data.reading import GivenEdge, Reading
from erag.data.writer import write_folder
from erag.pipeline.session import Memory, open_memory


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory, fake_config: Path) -> Memory:
    """The park that was driven through twice, with NDVI that rises along the way and falls between the visits."""
    nodes = twice().nodes
    read = [replace(n, sensors={"ndvi": 0.6 + 0.02 * i} if i < 8 else {"ndvi": 0.1}) for i, n in enumerate(nodes[:-1])]
    ways = [(f"{v}{i}", f"{v}{i + 1}") for v in "ab" for i in range(7)]
    edges = tuple(GivenEdge(a, b, EdgeKind.PATH, 2.0) for a, b in ways)
    out = tmp_path_factory.mktemp("aware")
    reading = Reading("twice", out, Frame.METRIC, (*read, nodes[-1]), edges, sensors={"ndvi": (-1.0, 1.0)})
    write_folder(out / "twice", reading)
    settings = ["answer={explain: quotes, least_evidence: 0, least_explained: 0}"]
    made = open_memory(out / "twice.erag", config=fake_config, overrides=settings)
    made.ingest(out / "twice")
    made.build()
    return made


def ask(memory: Memory, text: str, **more: object) -> tuple[Answer, Result]:
    result = memory.query(text, **more)  # type: ignore[arg-type]
    assert result.answer is not None
    return result.answer, result


def test_what_is_gone_and_what_is_new(memory: Memory) -> None:
    gone, found = ask(memory, "What has disappeared since the first visit?")
    assert "a tent (seen at a" in gone.text
    assert "ladder" not in gone.text
    assert found.hits[0].node in gone.evidence
    assert "a ladder (seen at b" in ask(memory, "What is new since the first visit?")[0].text


def test_when_and_where_a_thing_was_last_seen(memory: Memory) -> None:
    when, found = ask(memory, "When did you last see the tent?")
    assert when.kind == "explain"
    assert "2025-04-12 09:00 UTC at a4, 6 months ago" in when.text
    assert "later view" in when.text
    assert found.hits[0].node == "a4"
    where, _ = ask(memory, "Where did you last see the tent?", at=(0.0, 0.0))
    assert where.waypoint is not None
    assert where.waypoint.node == "a4"
    assert ask(memory, "Is the tent still there?")[0].text.startswith(("Probably not", "Perhaps not"))
    assert ask(memory, "Is the bench still there?")[0].text.startswith("Yes")


def test_a_moment_that_is_told_makes_ages(memory: Memory) -> None:
    answer, _ = ask(memory, "How long ago did you see the ladder?", now="2025-10-27T16:30:00Z")
    assert "2 days ago" in answer.text


def test_how_many_there_are_by_visit(memory: Memory) -> None:
    answer, _ = ask(memory, "How many tents are there?")
    assert answer.text.startswith("About 1 tent on the first visit (2025-04-12), named in 3 of 8 views; about 0 tents")


def test_words_become_windows_and_the_user_is_told(memory: Memory) -> None:
    _, result = ask(memory, "Find a bench that is there now.")
    assert {hit.node[0] for hit in result.hits} == {"b"}
    assert any('"that is there now" was read as from 2025-10-25 16:30' in note for note in result.notes)
    _, morning = ask(memory, "Find a bench seen in the morning")
    assert {hit.node[0] for hit in morning.hits} == {"a"}
    _, hours = ask(memory, "Find a bench", hours=(16, 17))
    assert {hit.node[0] for hit in hours.hits} == {"b"}
    assert memory.query("Find a bench seen yesterday").hits == ()


def test_old_evidence_is_said_to_be_old(memory: Memory) -> None:
    old, _ = ask(memory, "Find a tent")
    assert old.text.endswith("It was last seen on 2025-04-12, 6 months before the newest observation of this memory.")
    new, _ = ask(memory, "Find a ladder")
    assert "last seen" not in new.text


def test_words_wish_for_readings_and_the_answer_tells_them(memory: Memory) -> None:
    answer, result = ask(memory, "Find a bench with lush grass", kind="find")
    assert any("was read as ndvi=high" in note for note in result.notes)
    assert "ndvi reads" in answer.reason
    assert result.hits[0].node[0] == "a"
    plain, result = ask(memory, "Find a bench", kind="find")
    assert all(hit.sensor is None for hit in result.hits)
    assert "ndvi" not in plain.reason
    _, none = ask(memory, "Find a bench of high temperature")
    assert "this memory has no readings of temperature: places are judged by what was seen alone" in none.notes


def test_an_explanation_of_a_channel_has_mean_and_trend(memory: Memory) -> None:
    answer, _ = ask(memory, "How is the vegetation?", kind="explain")
    assert "Vegetation (NDVI) is 0.40 on average" in answer.text
    assert "falling from 0.67 (2025-04-12) to 0.10 (2025-10-25)" in answer.text


@pytest.mark.parametrize(
    ("text", "scope", "views"),
    [
        ("What is seen within 3 m of the ladder?", "the region within 3 m of the ladder", 10),
        ("What does it look like on the way from a0 to a2?", "the way from a0 to a2 (4 m)", 10),
        ("Describe the tent", "the tent", 3),
    ],
)
def test_an_explanation_keeps_to_the_region_it_is_asked_of(memory: Memory, text: str, scope: str, views: int) -> None:
    found = memory.asker._answerer._scopes._regions
    assert found is not None
    region = found.of(text, None)
    assert region is not None
    assert (region.name, len(region.rows)) == (scope, views)


def test_the_whole_is_told_by_code(memory: Memory) -> None:
    answer, _ = ask(memory, "Which objects are seen most often here?")
    assert answer.text.split("\n")[0] == "Most often one sees benches (15 of 16 views), ladders (3), tents (3)."
    season, _ = ask(memory, "In which season was this place seen?")
    assert season.kind == "explain"
