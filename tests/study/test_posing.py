"""Cameras before objects of every class: they look at them, from within the room, and from nowhere inside a thing."""

import math
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from erag.core.errors import ConfigError
from erag.study import posing
from erag.study.posing import poses


def _thing(name: str, x: float, y: float, radius: float = 0.5, area: int = 0) -> SimpleNamespace:
    return SimpleNamespace(name=name, x=x, y=y, radius=radius, area=area)


def _world(*things: SimpleNamespace | None, room: bool = True) -> SimpleNamespace:
    area = SimpleNamespace(box=(0.0, 0.0, 8.0, 6.0), room=object() if room else None)
    return SimpleNamespace(things=things, scene=SimpleNamespace(areas=[area]))


THINGS = (_thing("desk", 2, 2), None, _thing("desk", 6, 4), _thing("lamp", 4, 3, 0.2), _thing("sofa", 1, 5, 1.0))


def test_every_class_is_looked_at_equally_often_and_from_within_the_room() -> None:
    found = list(poses(_world(*THINGS), np.random.default_rng(0), each=8))
    looked: Counter[str] = Counter()
    for pose in found:
        assert 0.3 < pose.x < 7.7
        assert 0.3 < pose.y < 5.7
        seen = [t for t in THINGS if t and abs(_turn(pose, t)) < 0.26]
        looked.update({t.name for t in seen})
        assert seen
        assert all(math.dist((pose.x, pose.y), (t.x, t.y)) > 0.3 for t in THINGS if t)
    assert len(found) >= 20
    assert min(looked[name] for name in ("desk", "lamp", "sofa")) >= 5


def _turn(pose: posing.Pose, thing: SimpleNamespace) -> float:
    """Radians between where a camera looks and where a thing is."""
    return math.remainder(math.atan2(thing.y - pose.y, thing.x - pose.x) - pose.yaw, 2 * math.pi)


def test_the_same_generator_gives_the_same_cameras() -> None:
    one, two = (list(poses(_world(*THINGS), np.random.default_rng(3), each=2)) for _ in range(2))
    assert one == two


def test_outdoors_there_are_no_walls_and_large_things_are_seen_from_afar() -> None:
    found = list(poses(_world(_thing("church", 4, 3, 8.0), room=False), np.random.default_rng(0), each=10))
    assert len(found) == 10
    away = [math.dist((p.x, p.y), (4, 3)) for p in found]
    assert min(away) > 15.9
    assert max(away) <= 30.01


def test_where_there_is_no_room_there_is_no_camera() -> None:
    crowd = [_thing("crate", x / 2, y / 2, 0.4) for x in range(17) for y in range(13)]
    assert list(poses(_world(*crowd), np.random.default_rng(0), each=3)) == []


def test_a_missing_simulator_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(name, name="pybullet")

    monkeypatch.setattr(posing.importlib, "import_module", missing)
    with pytest.raises(ConfigError, match="pybullet is not installed"):
        posing.simulator("dataset")
