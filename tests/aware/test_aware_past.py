"""Things in texts, what changed between two visits, how many there are, and what was seen when."""

from __future__ import annotations

import numpy as np
import pytest
from aware_worlds import FIRST, SECOND, drive, map_of, seconds, thing, twice, view

from erag.aware.asked import asked, asks_where
from erag.aware.changes import Comparison
from erag.aware.conditions import conditions, differing
from erag.aware.distinct import number
from erag.aware.past import Past
from erag.aware.readings import extremes, readings, standing
from erag.aware.sight import Sight
from erag.aware.things import Things
from erag.aware.visits import visits
from erag.core.types import TopoMap
from erag.retrieve.corpus import map_texts


def past_of(topomap: TopoMap) -> Past:
    return Past(topomap, map_texts(topomap), visits(topomap))


@pytest.mark.parametrize(
    ("text", "aspect", "thing"),
    [
        ("When did you last see the bicycle?", "last", "bicycle"),
        ("Where did you last see a red litter bin?", "last", "red litter bin"),
        ("Tell me when the pumpkin was seen last.", "last", "pumpkin"),
        ("Show me the place where a shrub was seen last.", "last", "shrub"),
        ("When did you first see a person?", "first", "person"),
        ("How long ago did you see the ladder near the pond?", "ago", "ladder"),
        ("How long has it been since you saw the hay bale?", "ago", "hay bale"),
        ("Is the tent still there?", "still", "tent"),
        ("How many people are there?", "count", "person"),
        ("What is the number of mirrors here?", "count", "mirror"),
        ("What has disappeared since the first visit?", "gone", ""),
        ("What is new here?", "new", ""),
        ("Which things were moved since last time?", "moved", ""),
        ("How do the two visits differ in season?", "changed", ""),
    ],
)
def test_what_a_question_asks_of_the_past(text: str, aspect: str, thing: str) -> None:
    found = asked(text)
    assert (found.aspect, " ".join(found.thing)) == (aspect, thing)


@pytest.mark.parametrize(
    "text", ["Find a bench.", "What is it like here?", "My last bus has gone.", "Find the newest car", None]
)
def test_ordinary_questions_ask_nothing_of_the_past(text: str | None) -> None:
    assert asked(text).aspect is None


def test_a_place_is_asked_for_by_where() -> None:
    assert asks_where("Where was the tent last seen?")
    assert not asks_where("When was the tent last seen?")


def test_things_have_one_name_whatever_describes_them() -> None:
    texts = [
        "On the left stand two red wooden coffee tables, and a grey coffee table is behind.",
        "A coffee table. No tents.",
    ]
    topomap = map_of([view(f"n{i}", i, FIRST, text) for i, text in enumerate(texts)])
    things = Things(topomap, texts)
    assert list(things.by_name) == [("coffee", "table")]
    first, second = things.by_name["coffee", "table"]
    assert (first.row, first.count, first.side) == (0, 2, "left")
    assert (second.row, second.count, second.side) == (1, 1, None)
    assert [m.row for m in things.of(("table",))] == [0, 1]
    assert things.of(("tent",)) == ()
    assert things.shown(("coffee", "table"), many=True) == "coffee tables"


def test_what_is_gone_and_new_and_what_stays() -> None:
    past = past_of(twice())
    found = past.changes(*past.visits)
    assert [c.name for c in found.of("gone")] == [("tent",)]
    assert [c.name for c in found.of("new")] == [("ladder",)]
    assert all(c.looked for c in found.changes)
    assert past.changes(past.visits[1], past.visits[0]).of("gone")[0].name == ("ladder",)


def test_a_thing_that_was_not_looked_at_again_is_not_gone() -> None:
    first = drive("a", FIRST, {3: "There is an orange tent."}, "An empty path.")
    away = [view(f"b{i}", 2.0 * i, SECOND, "An empty path.", i, yaw=np.pi, y=-60.0) for i in range(8)]
    past = past_of(map_of([*first, *away]))
    found = past.changes(*past.visits)
    assert found.of("gone") == ()
    assert ("tent",) in found.unseen


def test_objects_are_matched_by_name_and_place() -> None:
    first = [*drive("a", FIRST, {}, ""), thing("cup@a", "cup", 6.0, FIRST), thing("chair@a", "chair", 7.0, FIRST)]
    second = [*drive("b", SECOND, {}, ""), thing("chair@b", "chair", 7.3, SECOND)]
    past = past_of(map_of([*first, *second]))
    found = past.changes(*past.visits)
    assert [c.name for c in found.changes] == [("cup",)]


def test_other_words_for_one_thing_are_no_change() -> None:
    first = drive("a", FIRST, dict.fromkeys((2, 3, 4), "There is a litter bin."), "An empty path.")
    second = drive("b", SECOND, dict.fromkeys((2, 3, 4), "There is a trashcan."), "An empty path.")
    topomap = map_of([*first, *second])
    before, after = visits(topomap)
    things = Things(topomap, map_texts(topomap))

    def same(one: tuple[str, ...], other: tuple[str, ...]) -> bool:
        return {one[-1], other[-1]} <= {"bin", "trashcan"}

    assert Comparison(things, Sight(topomap)).between(before.rows, after.rows).of("gone")
    assert not Comparison(things, Sight(topomap), same).between(before.rows, after.rows).changes


def test_views_of_one_thing_count_it_once_and_things_apart_twice() -> None:
    same = [view(f"n{i}", 1.0 * i, FIRST, "A bench stands in the centre of the view.", i) for i in range(4)]
    far = [view(f"f{i}", 200.0 + i, FIRST, "A bench stands in the centre of the view.", 4 + i) for i in range(3)]
    topomap = map_of([*same, *far])
    past = past_of(topomap)
    assert past.number(("bench",), np.arange(4)).count == 1
    both = past.number(("bench",), np.arange(7))
    assert (both.count, both.views, both.of, both.exact) == (2, 7, 7, False)


def test_several_in_one_view_are_that_many_and_objects_are_exact() -> None:
    topomap = map_of([view("n0", 0.0, FIRST, "There are three benches.")])
    assert number(Things(topomap, map_texts(topomap)).of(("bench",)), np.arange(1), Sight(topomap)).count == 3
    objects = map_of(
        [thing("c1", "chair", 0.0, FIRST), thing("c2", "chair", 0.4, FIRST), thing("c3", "chair", 5.0, FIRST)]
    )
    found = past_of(objects).number(("chair",), np.arange(3))
    assert (found.count, found.exact) == (2, True)


def test_the_last_sighting_and_the_views_that_miss_it_since() -> None:
    past = past_of(twice())
    everywhere = np.ones(16, np.bool_)
    found = past.last(past.mentions(("tent",), everywhere))
    assert found is not None
    assert (found.row, found.seconds) == (4, seconds(FIRST) + 40)
    assert set(found.missed) <= set(range(8, 16))
    assert found.missed
    first = past.first(past.mentions(("tent",), everywhere))
    assert first is not None
    assert first.row == 2
    assert past.mentions(("tent",), np.zeros(16, np.bool_)) == ()


def test_visits_compared_are_the_last_before_a_moment_and_the_newest() -> None:
    past = past_of(twice())
    pair = past.compared(None)
    assert pair is not None
    assert [v.number for v in pair] == [1, 2]
    assert past.compared(None, until=seconds(SECOND)) is None


def test_readings_have_mean_spread_and_a_trend_over_visits() -> None:
    nodes = [view(f"a{i}", i, FIRST, "Grass.", i, ndvi=0.6 + 0.01 * i) for i in range(4)]
    nodes += [view(f"b{i}", i, SECOND, "Grass.", i, ndvi=0.2 + 0.01 * i) for i in range(4)]
    nodes += [view("c", 9, SECOND, "Grass.", 5)]
    topomap = map_of(nodes)
    found = readings(topomap, np.arange(9), "ndvi", [v.rows for v in visits(topomap)])
    assert found is not None
    assert found.trend is not None
    assert (found.of, found.read) == (9, 8)
    assert found.mean == pytest.approx(0.415)
    assert found.spread > 0.19
    assert found.trend.clear
    assert "falling from 0.61 (2025-04-12) to 0.21 (2025-10-25)" in found.line()
    assert readings(topomap, np.array([8]), "ndvi") is None
    parts = [("a", np.arange(4)), ("b", np.arange(4, 8)), ("none", np.array([8]))]
    assert [name for name, _ in extremes(topomap, parts, "ndvi")] == ["a", "b"]
    assert standing(np.array([0.1, 0.2, np.nan, 0.3]), 0.3) == pytest.approx(2.5 / 3)


def test_season_and_weather_are_told_by_visit() -> None:
    texts = ["On a sunny spring morning."] * 3 + ["A winter day with snow on the ground."] * 3
    before, after = np.arange(3), np.arange(3, 6)
    assert conditions(texts, before)["spring"] == 1.0
    first, second = differing(texts, before, after)
    assert "spring (100%)" in first
    assert "winter (100%)" in second
