"""Worlds: what the scene descriptions promise, and that a seed decides everything."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import pytest

from erag.core.errors import ConfigError
from erag.sim.camera import BODIES
from erag.sim.dataset import open_world
from erag.sim.layout import World, corners
from erag.sim.scene import parse_scene, scene_heads, scene_names, scene_text
from erag.sim.vocabulary import classes

TINY = """
title: yard
kind: yard
setting: outdoor
split: train
number: 99
robot: wheeled
ground: good grass
visits: [{start: "2025-05-01T10:00:00Z", season: summer, light: midday}]
areas: [{place: yard, name: yard, box: [0, 0, 10, 10], stands: [{what: bench, at: [[5, 5]]}]}]
path: {points: [[0, 0], [10, 0]], nodes: 5}
"""


@pytest.fixture(scope="module")
def opened() -> Mapping[str, Sequence[World]]:
    return {name: open_world(name, 0) for name in scene_names() if name != "town"}


def test_there_are_enough_worlds_of_enough_kinds() -> None:
    heads = dict(scene_heads())
    assert len(heads) >= 14
    assert len({h.kind for h in heads.values()}) >= 8
    assert {h.setting for h in heads.values()} == {"indoor", "outdoor", "mixed"}
    assert {h.robot for h in heads.values()} == set(BODIES)
    assert [h.split for h in heads.values()] == ["train"] * 10 + ["test"] * (len(heads) - 10)
    assert [h.number for h in heads.values()] == list(range(1, len(heads) + 1))
    assert sum(len(h.visits) == 2 for h in heads.values()) >= 4


def test_a_world_has_about_fifty_nodes(opened: Mapping[str, Sequence[World]]) -> None:
    assert all(45 <= len(w.stops) <= 60 for visits in opened.values() for w in visits)


def test_the_town_has_three_thousand_nodes() -> None:
    (town,) = open_world("town", 0)
    assert len(town.stops) >= 3000
    assert sum(t is not None for t in town.things) >= 3000
    steps = [b.metres - a.metres for a, b in pairwise(town.stops)]
    assert max(steps) < 12


def test_every_held_out_class_is_known_from_training(opened: Mapping[str, Sequence[World]]) -> None:
    seen: dict[str, set[str]] = {"train": set(), "test": set()}
    for visits in opened.values():
        seen[visits[0].scene.split] |= {t.name for t in visits[0].things if t}
    assert seen["test"] <= seen["train"]
    assert len(seen["train"]) == len(classes())


def test_held_out_worlds_use_held_out_looks(opened: Mapping[str, Sequence[World]]) -> None:
    for visits in opened.values():
        split = visits[0].scene.split
        for t in filter(None, visits[0].things):
            looks = classes()[t.name].styles(split)
            assert not looks.colours or t.style.colour in looks.colours, t.id


def test_no_camera_stands_in_an_object(opened: Mapping[str, Sequence[World]]) -> None:
    for visits in opened.values():
        for world in visits:
            for thing in filter(None, world.things):
                if classes()[thing.name].flat or thing.z > 0.3 or _top(thing) < BODIES[world.scene.robot][0] - 0.6:
                    continue
                (x0, y0), (x1, y1) = corners(thing)
                inside = [s.index for s in world.stops if x0 < s.camera.x < x1 and y0 < s.camera.y < y1]
                assert not inside, (thing.id, inside)


def test_the_same_seed_gives_the_same_world_and_another_another() -> None:
    a, b, c = (open_world("park", seed)[0] for seed in (0, 0, 1))
    assert a.things == b.things
    assert a.stops == b.stops
    assert a.things != c.things
    assert Counter(t.name for t in a.things if t) != Counter() != Counter(t.name for t in c.things if t)


def test_a_second_visit_differs_and_keeps_ids(opened: Mapping[str, Sequence[World]]) -> None:
    twice = {n: v for n, v in opened.items() if len(v) == 2}
    assert len(twice) >= 4
    for first, second in twice.values():
        before, after = ({t.id: t for t in w.things if t} for w in (first, second))
        assert before.keys() - after.keys(), "nothing is gone"
        assert after.keys() - before.keys(), "nothing is new"
        assert any((before[i].x, before[i].y) != (after[i].x, after[i].y) for i in before.keys() & after.keys())
        assert all(before[i].style == after[i].style for i in before.keys() & after.keys())
        assert first.when.start < second.when.start


def test_stops_are_evenly_spaced_on_a_free_path() -> None:
    from erag.sim.layout import worlds

    (world,) = worlds("yard", parse_scene(TINY, "tiny"), 0)
    assert [s.camera.x for s in world.stops] == pytest.approx([0, 2.5, 5, 7.5, 10])
    assert world.stops[-1].metres == pytest.approx(10)
    towards = world.stops[1].camera
    bench = next(t for t in world.things if t)
    assert towards.yaw == pytest.approx(math.atan2(bench.y - towards.y, bench.x - towards.x), abs=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bench", "throne", "throne"),
        ("good grass", "lava", "lava"),
        ("at: [[5, 5]]", "at: [[5, 5]], scatter: 2", "exactly one"),
        ("wheeled", "hovering", "robot"),
        ("title: yard", "name: yard", "title"),
        ("nodes: 5", "nodes: 1", "nodes"),
    ],
)
def test_a_wrong_description_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as error:
        parse_scene(TINY.replace(old, new, 1), "tiny.yaml")
    assert "tiny.yaml" in error.value.line()
    assert "\n" not in error.value.line()


def test_an_unknown_world_names_those_there_are() -> None:
    with pytest.raises(ConfigError, match=r"moon.*park"):
        scene_text("moon")


def _top(thing: object) -> float:
    from erag.sim.layout import Thing, extent

    assert isinstance(thing, Thing)
    return thing.z + extent(thing.name, thing.style, 0.0)[5]
