"""Studios: scenes in which objects of all kinds stand where they never would, so that a learner looks at the object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np

from erag.sim.camera import BODIES
from erag.sim.layout import extent, generator
from erag.sim.model import Style
from erag.sim.scene import Scene
from erag.sim.vocabulary import classes, validated

NODES = 36
OUTDOORS = ("good grass", "worn grass", "dry grass", "meadow", "sand", "gravel", "asphalt", "paving", "cobbles",
            "bark chips", "concrete", "soil", "crop", "snow", "stubble")  # fmt: skip
FLOORS = ("carpet", "warm carpet", "parquet", "floor tiles", "chequered", "linoleum", "screed", "concrete", "planks")
WALLS = ("plaster", "painted wall", "brick", "concrete", "pale wood", "planks", "stone")
LIGHTS = ("morning", "midday", "overcast", "evening", "night")
WEATHERS = ("clear", "clear", "cloudy", "misty")
SEASONS = ("spring", "summer", "autumn", "winter")
SIDES = ("north", "east", "south", "west")
LARGE = 2.2  # metres: what is wider does not go into a room


def studio_scene(number: int, seed: int, *, painted: bool = False) -> Scene:
    """A scene of its own for each number: one in three is a suite of rooms, the others are open ground.

    Objects have the looks of training worlds; `painted` ones any colour but those that held-out worlds keep for their
    class. Places have no kind.
    """
    rng = generator(seed, "painted studio" if painted else "studio", number)
    raw = _rooms(rng) if number % 3 == 2 else _open(rng)
    if painted:
        for area in raw["areas"]:
            area["stands"] = [_painted(stand, rng) for stand in area["stands"]]
    return validated(Scene, raw, f"studio {number}")


def _painted(stand: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    kind = classes()[stand["what"]]
    if not any(kind.train.colours):
        return stand
    kept = set(kind.held_out.colours) if kind.held_out else set()
    return stand | {"colour": _one(rng, [c for c in _palette() if c not in kept])}


@cache
def _palette() -> tuple[str, ...]:
    return tuple(sorted({c for kind in classes().values() for c in kind.train.colours if c}))


def _open(rng: np.random.Generator) -> dict[str, Any]:
    side = 34.0
    names = [n for n, kind in classes().items() if not kind.height]
    small = [n for n in names if not classes()[n].big]
    big = [n for n in names if classes()[n].big]
    inner = {"place": "", "name": "open ground", "ground": _one(rng, OUTDOORS), "box": (0, 0, side, side)}
    ring = ((-26, -26, side + 26, 0), (-26, side, side + 26, side + 26), (-26, 0, 0, side), (side, 0, side + 26, side))
    outer = [{"place": "", "name": "open ground", "box": box, "stands": _scattered(rng, big, 5)} for box in ring]
    visit = {
        "start": "2025-06-01T12:00:00Z", "season": _one(rng, SEASONS), "light": _one(rng, LIGHTS),
        "weather": _one(rng, WEATHERS),
    }  # fmt: skip
    walk = ((8.0, 8.0), (26.0, 8.0), (26.0, 26.0), (8.0, 26.0), (8.0, 10.0), (17.0, 17.0))
    return {
        **_head(rng, visit, "outdoor"), "ground": _one(rng, OUTDOORS),
        "areas": [inner | {"stands": _scattered(rng, small, 46)}, *outer], "path": _path(walk),
    }  # fmt: skip


def _rooms(rng: np.random.Generator) -> dict[str, Any]:
    width, depth = 8.0, 7.0
    hung = [n for n, kind in classes().items() if kind.height]
    fitting = [n for n, kind in classes().items() if not kind.height and not kind.big and _width(n) <= LARGE]
    areas = []
    for row in range(2):
        for column in range(2):
            x, y = column * width, row * depth
            room = {"floor": _one(rng, FLOORS), "wall": _one(rng, WALLS)}
            stands = [*_hung(rng, hung), *_scattered(rng, fitting, 12)]
            areas.append({
                "place": "", "name": "room", "box": (x, y, x + width, y + depth), "room": room, "stands": stands,
            })  # fmt: skip
    visit = {"start": "2025-06-01T12:00:00Z", "season": "summer", "light": "indoor"}
    doors = ((width, depth / 2), (1.5 * width, depth), (width, 1.5 * depth), (width / 2, depth))
    walk = ((2.0, 3.5), (14.0, 3.5), (12.0, 10.5), (2.0, 10.5), (4.0, 5.0))
    return {
        **_head(rng, visit, "indoor"), "ground": "concrete", "areas": areas, "doors": doors, "path": _path(walk),
    }  # fmt: skip


def _head(rng: np.random.Generator, visit: dict[str, Any], setting: str) -> dict[str, Any]:
    return {
        "title": "studio", "kind": "studio", "setting": setting, "split": "train", "number": 1,
        "robot": _one(rng, tuple(BODIES) if setting == "outdoor" else ("quadruped", "wheeled")), "visits": [visit],
    }  # fmt: skip


def _path(points: Sequence[tuple[float, float]]) -> dict[str, Any]:
    return {"points": points, "nodes": NODES, "look": ("thing", "thing", 40.0, "thing", "thing", -60.0)}


def _scattered(rng: np.random.Generator, names: Sequence[str], count: int) -> list[dict[str, Any]]:
    """Objects of `count` different classes, one or two of each."""
    chosen = rng.choice(len(names), min(count, len(names)), replace=False)
    return [{"what": names[i], "scatter": int(rng.integers(1, 3))} for i in chosen.tolist()]


def _hung(rng: np.random.Generator, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    for i in rng.choice(len(names), min(5, len(names)), replace=False).tolist():
        yield {"what": names[i], "wall": _one(rng, SIDES), "along": (round(float(rng.uniform(0.1, 0.9)), 2),)}


def _width(name: str) -> float:
    looks = classes()[name].styles("train")
    x0, y0, _, x1, y1, _ = extent(name, Style(next(iter(looks.shapes)), "", "", 0, None), 0.0)
    return max(x1 - x0, y1 - y0)


def _one(rng: np.random.Generator, choices: Sequence[str]) -> str:
    return choices[int(rng.integers(len(choices)))]
