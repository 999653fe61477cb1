"""From a scene description and a seed to a world: every object in its place and style, for each visit."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from erag.sim import rooms
from erag.sim.camera import BODIES
from erag.sim.materials import in_season
from erag.sim.mesh import bounds
from erag.sim.model import Part, Style
from erag.sim.renderer import Solid
from erag.sim.route import Stop, Target, clearance, stops
from erag.sim.scene import COMPASS, Area, Box, Point2, Scene, Stand, Visit
from erag.sim.shapes import BUILDERS
from erag.sim.vocabulary import classes

BACKDROP = 400.0  # metres of ground round a world
LIFT = 0.012  # metres by which each ground lies above the one before, against flicker
ROOM_TO_PASS = 0.55  # metres kept free beside the path
TRIES = 60
WORKTOPS = {"reception counter": 1.11, "kitchen sink": 0.89}  # metres, where the highest point is something else


@dataclass(frozen=True)
class Thing:
    """An object of a world: its id, class, style, and where it stands (metres, degrees); `area` is a row of the scene.

    `only` is the visit it is restricted to, or None. `radius` is that of its footprint.
    """

    id: str
    name: str
    style: Style
    x: float
    y: float
    z: float
    yaw: float
    area: int
    radius: float
    only: int | None = None

    @property
    def parts(self) -> tuple[Part, ...]:
        """What it is made of."""
        return made(self.name, self.style)


@dataclass(frozen=True)
class World:
    """A world as it is on one visit: `solids` to render, and for each row its thing (None: ground, wall) and area."""

    name: str
    scene: Scene
    visit: int  # from 1
    solids: tuple[Solid, ...]
    things: tuple[Thing | None, ...]
    areas: tuple[int, ...]  # row of the area, −1 for the world's own ground
    stops: tuple[Stop, ...]

    @property
    def when(self) -> Visit:
        """Season, light and time of this visit."""
        return self.scene.visits[self.visit - 1]


@lru_cache(maxsize=8192)
def made(name: str, style: Style) -> tuple[Part, ...]:
    """The parts of an object of class `name` in `style`."""
    return tuple(BUILDERS[name](style))


@lru_cache(maxsize=65536)
def extent(name: str, style: Style, yaw: float) -> tuple[float, ...]:
    """Lowest and highest x, y, z (x0, y0, z0, x1, y1, z1) of an object turned by `yaw` degrees, in metres."""
    low, high = bounds([p.mesh.turned(yaw) for p in made(name, style)])
    return tuple(float(v) for v in (*low, *high))


def worlds(name: str, scene: Scene, seed: int) -> tuple[World, ...]:
    """The world of a scene on each of its visits, the same for the same seed."""
    things = tuple(_furnish(name, scene, seed))
    return tuple(_world(name, scene, k, _changed(things, scene, k, seed)) for k in range(1, len(scene.visits) + 1))


def generator(*keys: int | str) -> np.random.Generator:
    """A generator of its own for each combination of keys, so that one change leaves the rest as it was."""
    return np.random.default_rng([k if isinstance(k, int) else zlib.crc32(k.encode()) for k in keys])


def _furnish(name: str, scene: Scene, seed: int) -> Iterator[Thing]:
    counts: Counter[str] = Counter()
    for row, area in enumerate(scene.areas):
        placed: list[Thing] = []
        for number, stand in enumerate(area.stands):
            rng = generator(seed, name, row, number)
            for thing in _stand(stand, area, row, scene, placed, rng):
                counts[thing.name] += 1
                slug = thing.name.replace(" ", "-")
                placed.append(replace(thing, id=f"{name}-{slug}-{counts[thing.name]:02d}"))
        yield from placed


def _stand(
    stand: Stand, area: Area, row: int, scene: Scene, placed: list[Thing], rng: np.random.Generator
) -> Iterator[Thing]:
    fresh: list[Thing] = []
    for _ in range(stand.scatter):
        thing = _scattered(_styled(stand, scene.split, row, rng), area, scene, [*placed, *fresh], rng)
        if thing is not None:
            fresh.append(thing)
    for x, y, z, yaw in _spots(stand, area, placed):
        thing = _styled(stand, scene.split, row, rng)
        depth = _depth(thing, stand, area)
        turn = math.radians(yaw)
        x, y = x + math.cos(turn) * depth, y + math.sin(turn) * depth
        mobile = classes()[thing.name].mobile and not stand.on
        shake = rng.uniform(-1, 1, 3) * ((0.12, 0.12, 7.0) if mobile else (0.0, 0.0, 0.0))
        dx, dy, dyaw = shake.tolist()
        z += classes()[thing.name].height
        fresh.append(replace(thing, x=x + dx, y=y + dy, z=z, yaw=yaw + dyaw))
    yield from (t for t in fresh if rng.random() < stand.chance)


def _styled(stand: Stand, split: str, row: int, rng: np.random.Generator) -> Thing:
    """An object of the stand's class, not yet in its place, in one of the looks that worlds of `split` may show."""
    name = stand.names[int(rng.integers(len(stand.names)))]
    kind = classes()[name]
    looks = kind.styles(split)
    shapes = list(looks.shapes)
    shape = shapes[int(rng.integers(len(shapes)))] if stand.shape is None else stand.shape
    colour = stand.colour or (looks.colours[int(rng.integers(len(looks.colours)))] if looks.colours else "")
    text = stand.text or (kind.texts[int(rng.integers(len(kind.texts)))] if kind.texts else "")
    style = Style(shape, colour, text, int(rng.integers(24)), stand.extent)
    x0, y0, _, x1, y1, _ = extent(name, style, 0.0)
    radius = max(-x0, -y0, x1, y1)
    return Thing("", name, style, 0.0, 0.0, 0.0, 0.0, row, radius, stand.only)


def _spots(stand: Stand, area: Area, placed: Sequence[Thing]) -> Iterator[tuple[float, float, float, float]]:
    """Where a stand says that something stands: x, y, z in world metres and degrees."""
    x0, y0 = area.box[:2]
    turn = _degrees(stand.facing)
    yield from ((x0 + x, y0 + y, 0.0, turn or 0.0) for x, y in stand.at)
    if stand.row is not None:
        (ax, ay), (bx, by) = stand.row
        for t in np.linspace(0, 1, stand.count):
            yield x0 + ax + (bx - ax) * float(t), y0 + ay + (by - ay) * float(t), 0.0, turn or 0.0
    if stand.wall is not None:
        for fraction in stand.along:
            x, y = rooms.point_on(area.box, stand.wall, fraction, 0.0)
            yield x, y, 0.0, rooms.inward(stand.wall) if turn is None else turn
    for below in [t for t in placed if stand.on and t.name == stand.on]:
        yield below.x, below.y, below.z + _top(below), below.yaw + (turn or 0.0)


def _depth(thing: Thing, stand: Stand, area: Area) -> float:
    """How far its origin is from the wall it has its back to, so that it touches it; 0 away from walls."""
    if stand.wall is None:
        return 0.0
    return -extent(thing.name, thing.style, 0.0)[0] + (rooms.THICK if area.room else 0.0) + 0.02 + stand.gap


def _scattered(
    thing: Thing, area: Area, scene: Scene, others: Sequence[Thing], rng: np.random.Generator
) -> Thing | None:
    x0, y0, x1, y1 = area.box
    edge = min(thing.radius, (x1 - x0) / 2 - 0.01, (y1 - y0) / 2 - 0.01)
    for _ in range(TRIES):
        x, y = float(rng.uniform(x0 + edge, x1 - edge)), float(rng.uniform(y0 + edge, y1 - edge))
        free = all(math.dist((x, y), (o.x, o.y)) > (thing.radius + o.radius) * 0.9 for o in others)
        if free and clearance(scene.path, (x, y)) > thing.radius + ROOM_TO_PASS:
            return replace(thing, x=x, y=y, yaw=float(rng.uniform(0, 360)))
    return None


def _changed(things: Sequence[Thing], scene: Scene, visit: int, seed: int) -> tuple[Thing, ...]:
    """What is there on a visit: some mobile things have gone or moved since the first, some came."""
    when, kept = scene.visits[visit - 1], []
    for thing in things:
        rng = generator(seed, thing.id, visit)
        fate = rng.random() if classes()[thing.name].mobile and thing.only is None and thing.z == 0 else 1.0
        if thing.only not in (None, visit) or fate < when.gone:
            continue
        if fate < when.gone + when.moved:
            others = [t for t in things if t.area == thing.area and t is not thing]
            kept.append(_scattered(thing, scene.areas[thing.area], scene, others, rng) or thing)
        else:
            kept.append(thing)
    return tuple(kept)


def _world(name: str, scene: Scene, visit: int, things: Sequence[Thing]) -> World:
    when = scene.visits[visit - 1]
    snow = when.weather == "snow"
    rows: list[tuple[Solid, Thing | None, int]] = []
    for parts, area in _structure(scene):
        outdoors = area < 0 or scene.areas[area].room is None
        rows.append((Solid(_seasonal(parts, when, snow) if outdoors else parts), None, area))
    for t in things:
        outdoors = scene.areas[t.area].room is None
        parts = _seasonal(t.parts, when, snow) if outdoors else t.parts
        rows.append((Solid(parts, t.x, t.y, t.z, t.yaw), t, t.area))
    solids, owners, areas = zip(*rows, strict=True)
    targets = [_target(t, scene) for t in things]
    height = BODIES[scene.robot][0]
    boxes = [box for t in things if (box := _obstacle(t, height)) is not None]
    way = stops(scene.path, scene.robot, targets, boxes, lambda at: _room(at, scene))
    return World(name, scene, visit, solids, owners, areas, way)


def _target(thing: Thing, scene: Scene) -> Target:
    x0, y0, z0, x1, y1, z1 = extent(thing.name, thing.style, 0.0)
    room = thing.area if scene.areas[thing.area].room is not None else -1
    return Target(thing.x, thing.y, max(x1 - x0, y1 - y0, z1 - z0) / 2, room)


def _obstacle(thing: Thing, height: float) -> Box | None:
    """The footprint of what a camera at `height` metres would run into; None for rugs, things hung up, things below."""
    top = thing.z + extent(thing.name, thing.style, 0.0)[5]
    if classes()[thing.name].flat or thing.z > 0.3 or top < height - 0.6:
        return None
    (x0, y0), (x1, y1) = corners(thing)
    return x0, y0, x1, y1


def _room(at: Point2, scene: Scene) -> int:
    """The row of the area with a room that a point lies in, or −1."""
    inside = (i for i, a in enumerate(scene.areas) if a.room is not None and contains(a, at))
    return next(inside, -1)


def contains(area: Area, at: Point2) -> bool:
    """Whether a point lies in an area."""
    x0, y0, x1, y1 = area.box
    return x0 <= at[0] <= x1 and y0 <= at[1] <= y1


def _structure(scene: Scene) -> Iterator[tuple[tuple[Part, ...], int]]:
    """Grounds, floors and walls, each with the row of its area."""
    half = BACKDROP / 2
    cx, cy = (sum(p[i] for p in scene.path.points) / len(scene.path.points) for i in (0, 1))
    span = max(half, *(abs(p[i] - (cx, cy)[i]) + 150 for p in scene.path.points for i in (0, 1)))
    yield (rooms.ground(scene.ground, (cx - span, cy - span, cx + span, cy + span), 0.0),), -1
    layers = list(dict.fromkeys(g.material for g in scene.grounds))  # a material lies on those named before it
    for g in scene.grounds:
        yield (rooms.ground(g.material, g.box, LIFT * (1 + layers.index(g.material))),), -1
    for row, area in enumerate(scene.areas):
        if area.ground:
            yield (rooms.ground(area.ground, area.box, LIFT * (len(layers) + 1)),), row
        if area.room is not None:
            for p in rooms.room_parts(area, scene.doors, LIFT * (len(layers) + 2)):
                yield (p,), row


def _seasonal(parts: Sequence[Part], when: Visit, snow: bool) -> tuple[Part, ...]:
    return tuple(replace(p, material=in_season(p.material, when.season, snow=snow)) for p in parts)


def _degrees(facing: str | float | None) -> float | None:
    if isinstance(facing, str):
        return COMPASS[facing]
    return facing


def corners(thing: Thing) -> tuple[Point2, Point2]:
    """The footprint's box in world metres: its south-west and north-east corner."""
    x0, y0, _, x1, y1, _ = extent(thing.name, thing.style, thing.yaw)
    return (thing.x + x0, thing.y + y0), (thing.x + x1, thing.y + y1)


def _top(thing: Thing) -> float:
    """The height in metres of the surface that something may stand on."""
    return WORKTOPS.get(thing.name) or extent(thing.name, thing.style, 0.0)[5]
