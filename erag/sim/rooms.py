"""Walls with gaps for doors, windows, floors, ceilings and grounds of a scene, as parts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from erag.sim.mesh import Mesh, box, panel, sheet
from erag.sim.model import Part, Parts, Picture, part
from erag.sim.scene import Area, Box, Point2, Room, Side

THICK = 0.12  # metres of a wall; two rooms that touch have a wall each
DOOR_WIDTH, DOOR_HEIGHT = 1.3, 2.15
WINDOW_WIDTH, WINDOW_HEIGHT, SILL = 1.5, 1.3, 0.95
SIDES: tuple[Side, ...] = ("north", "east", "south", "west")


def ground(material: str, area: Box, height: float) -> Part:
    """A level rectangle of a material, in world coordinates."""
    x0, y0, x1, y1 = area
    return part(material, sheet(x1 - x0, y1 - y0, ((x0 + x1) / 2, (y0 + y1) / 2, height)))


def room_parts(area: Area, doors: Sequence[Point2], height: float) -> Parts:
    """Floor, ceiling, walls and windows of an area's room, in world coordinates; nothing if it has none."""
    if area.room is None:
        return []
    room, (x0, y0, x1, y1) = area.room, area.box
    lid = sheet(x1 - x0, y1 - y0).turned(180, "x").moved((x0 + x1) / 2, (y0 + y1) / 2, room.height)
    walls = [m for side in SIDES if side not in room.open for m in _wall(area.box, side, room.height, doors)]
    panes = [m for side in room.windows for m in _windows(area.box, side, doors)]
    parts = [
        ground(room.floor, area.box, height),
        part(room.ceiling, lid),
        *([part(room.wall, *walls)] if walls else []),
    ]
    if panes:
        parts.append(part("lit picture", *panes, picture=Picture("window", aspect=WINDOW_WIDTH / WINDOW_HEIGHT)))
    return parts


def skirting(room: Room) -> float:
    """How far from the area's edge things hung on a wall have to be."""
    return THICK if room.wall else 0.0


def line(area: Box, side: Side) -> tuple[Point2, Point2]:
    """The two ends of a side of a box, in counter-clockwise order."""
    x0, y0, x1, y1 = area
    corners = {
        "south": ((x0, y0), (x1, y0)),
        "east": ((x1, y0), (x1, y1)),
        "north": ((x1, y1), (x0, y1)),
        "west": ((x0, y1), (x0, y0)),
    }
    return corners[side]


def inward(side: Side) -> float:
    """Degrees of the direction from a side into the area."""
    return {"south": 90.0, "east": 180.0, "north": 270.0, "west": 0.0}[side]


def point_on(area: Box, side: Side, fraction: float, depth: float) -> Point2:
    """The point at `fraction` of a side, west to east or south to north, `depth` metres into the area."""
    x0, y0, x1, y1 = area
    x, y = x0 + (x1 - x0) * fraction, y0 + (y1 - y0) * fraction
    return {"south": (x, y0 + depth), "north": (x, y1 - depth), "west": (x0 + depth, y), "east": (x1 - depth, y)}[side]


def _wall(area: Box, side: Side, height: float, doors: Sequence[Point2]) -> Iterable[Mesh]:
    a, b = line(area, side)
    length = math.dist(a, b)
    gaps = sorted(g for g in (_along(a, b, d) for d in doors) if g is not None)
    start = 0.0
    for gap in gaps:
        yield _slab(a, b, start, gap - DOOR_WIDTH / 2, 0.0, height)
        yield _slab(a, b, gap - DOOR_WIDTH / 2, gap + DOOR_WIDTH / 2, DOOR_HEIGHT, height)
        start = gap + DOOR_WIDTH / 2
    yield _slab(a, b, start, length, 0.0, height)


def _along(a: Point2, b: Point2, door: Point2) -> float | None:
    """Metres from `a` towards `b` at which a door lies on this wall, or None."""
    length = math.dist(a, b)
    t = ((door[0] - a[0]) * (b[0] - a[0]) + (door[1] - a[1]) * (b[1] - a[1])) / length
    off = abs((door[0] - a[0]) * (b[1] - a[1]) - (door[1] - a[1]) * (b[0] - a[0])) / length
    return t if off < 0.3 and DOOR_WIDTH / 2 <= t <= length - DOOR_WIDTH / 2 else None


def _slab(a: Point2, b: Point2, start: float, end: float, low: float, high: float) -> Mesh:
    """A piece of wall from `start` to `end` metres of a → b, inside the area (left of the line)."""
    angle = math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))
    piece = box(max(end - start, 0.01), THICK, high - low, ((start + end) / 2, THICK / 2, low))
    return piece.turned(angle).moved(*a)


def _windows(area: Box, side: Side, doors: Sequence[Point2]) -> Iterable[Mesh]:
    a, b = line(area, side)
    length = math.dist(a, b)
    gaps = [g for g in (_along(a, b, d) for d in doors) if g is not None]
    count = max(1, int(length / 3.2))
    for i in range(count):
        at = (i + 0.5) / count
        clear = all(abs(g - at * length) > DOOR_WIDTH / 2 + WINDOW_WIDTH / 2 for g in gaps)
        if clear and length > WINDOW_WIDTH + 0.4:
            x, y = a[0] + (b[0] - a[0]) * at, a[1] + (b[1] - a[1]) * at
            turn = inward(side)
            dx, dy = math.cos(math.radians(turn)) * (THICK + 0.01), math.sin(math.radians(turn)) * (THICK + 0.01)
            yield panel(WINDOW_WIDTH, WINDOW_HEIGHT, (x + dx, y + dy, SILL), turn)
