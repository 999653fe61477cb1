"""Buildings and other things larger than a room."""

from __future__ import annotations

import math

from erag.sim.mesh import Mesh, box, cylinder, lathe, panel, prism, quad, rod, sheet
from erag.sim.model import PALETTE, Parts, Picture, Style, part

DOOR = (0.35, 0.2, 0.12)


def _gable(deep: float, wide: float, base: float, rise: float, over: float = 0.35) -> Mesh:
    d = deep / 2 + over
    return prism(((-d, base), (d, base), (0, base + rise)), wide + 2 * over)


def _door(x: float, y: float = 0.0, tint: tuple[float, float, float] = DOOR) -> Parts:
    return [
        part("wood", box(0.12, 1.1, 2.1, (x, y, 0)), tint=tint),
        part("brass", box(0.16, 0.08, 0.08, (x + 0.04, y + 0.36, 1.0))),
    ]


def house(s: Style) -> Parts:
    wall = ("brick front", "plaster front", "blue front", "yellow brick front")[s.shape % 4]
    deep, wide, high = 7.0, 9.0, 6.0
    roof = part("slate roof" if s.shape in (2, 3) else "red roof", _gable(deep, wide, high, 2.6))
    step = part("stone", box(1.2, 1.8, 0.18, (deep / 2 + 0.5, 0, 0)))
    porch = [
        part("wood", cylinder(0.06, 2.3, (deep / 2 + 1.0, y, 0)), box(1.2, 0.1, 0.1, (deep / 2 + 0.5, y, 2.3)))
        for y in (-0.8, 0.8)
    ]
    return [
        part(wall, box(deep, wide, high)),
        roof,
        step,
        *porch,
        part("slate roof", box(1.4, 2.0, 0.1, (deep / 2 + 0.6, 0, 2.4))),
        part("brick", box(0.7, 0.7, 1.8, (-1.2, 2.6, high + 1.2))),
        *_door(deep / 2 + 0.05, 0, s.tint if s.colour else DOOR),
    ]


def shop(s: Style) -> Parts:
    deep, wide, high = 6.0, 7.5, 6.3
    upper = "brick front" if s.shape == 0 else "plaster front" if s.shape == 1 else "white front"
    front = Picture("shopfront", ground=s.tint, aspect=2.2, seed=s.seed)
    name = Picture("bare", s.text or "SHOP", (1, 1, 0.94), s.tint, 8)
    x = deep / 2
    slope = quad(((x, -3.4, 2.75), (x + 1.3, -3.4, 2.3), (x + 1.3, 3.4, 2.3), (x, 3.4, 2.75)), (1.2, 6.8))
    return [
        part(upper, box(deep, wide, high - 3.3, (0, 0, 3.3))),
        part("brick", box(deep, wide, 3.3)),
        part("stone", box(deep + 0.3, wide + 0.1, 0.25, (0, 0, high))),
        part("picture", panel(7.3, 2.6, (x + 0.03, 0, 0.05)), picture=front),
        part("paint", box(0.16, wide, 0.7, (x, 0, 2.7)), tint=s.tint),
        part("lit picture", panel(6.4, 0.6, (x + 0.1, 0, 2.75)), picture=name),
        *([part("awning", slope)] if s.seed % 2 else []),
    ]


def apartment_block(s: Style) -> Parts:
    wall = ("plaster front", "yellow brick front", "white front")[s.shape % 3]
    deep, wide, high = 9.0, 15.0, 15.0
    slabs = [box(1.2, 3.0, 0.15, (deep / 2 + 0.5, y, z)) for y in (-4.5, 1.5) for z in (3.0, 6.0, 9.0, 12.0)]
    rails = [box(0.05, 3.0, 0.9, (deep / 2 + 1.05, y, z + 0.15)) for y in (-4.5, 1.5) for z in (3.0, 6.0, 9.0, 12.0)]
    return [
        part(wall, box(deep, wide, high)),
        part("concrete", box(deep + 0.4, wide + 0.4, 0.4, (0, 0, high)), *slabs),
        part("slats", *rails, tint=s.tint if s.colour else PALETTE["grey"]),
        *_door(deep / 2 + 0.05, -2.0, (0.2, 0.25, 0.3)),
    ]


def office_tower(s: Style) -> Parts:
    glass = "bronze glass front" if s.shape == 1 else "glass front"
    deep, wide, high = 12.0, 15.0, 24.0
    name = Picture("bare", s.text or "CENTRAL BANK", (1, 1, 1), (0.12, 0.16, 0.22), 7)
    return [
        part(glass, box(deep, wide, high)),
        part(
            "concrete",
            box(deep + 0.6, wide + 0.6, 0.6, (0, 0, high)),
            box(2.4, 5.0, 0.3, (deep / 2 + 1, 0, 3.2)),
            *(cylinder(0.15, 3.2, (deep / 2 + 1.9, y, 0)) for y in (-2.2, 2.2)),
        ),
        part("dark glass", box(0.1, 3.2, 2.8, (deep / 2 + 0.03, 0, 0))),
        part("lit picture", panel(6, 0.8, (deep / 2 + 0.1, 0, 3.7)), picture=name),
    ]


def church(s: Style) -> Parts:
    tower = [box(4.0, 4.0, 12.0, (5.0, 0, 0))]
    arches = [
        part("dark glass", box(0.1, 1.0, 2.2, (7.02, 0, 6.0)), *(box(1.0, 7.1, 3.0, (x, 0, 2.0)) for x in (-3.5, -0.5)))
    ]
    return [
        part("stone", box(11.0, 7.0, 6.0, (-2.0, 0, 0)), *tower),
        part(
            "slate roof",
            _gable(7.0, 11.0, 6.0, 4.0).turned(90).moved(-2.0),
            lathe(((3.2, 12.0), (0.0, 18.0)), (5.0, 0, 0), sides=4).turned(0),
        ),
        *arches,
        part("brass", box(0.12, 0.12, 1.4, (5.0, 0, 18.0)), box(0.12, 0.8, 0.12, (5.0, 0, 18.8))),
        part("dark wood", box(0.12, 1.7, 2.8, (7.02, 0, 0))),
        part("lit picture", panel(1.7, 1.7, (7.06, 0, 9.2)), picture=Picture("clock", seed=s.seed)),
    ]


def barn(s: Style) -> Parts:
    boards = "barn boards held" if s.shape == 1 else "barn boards"
    end = prism(((-4.5, 0), (4.5, 0), (4.5, 4.0), (2.6, 6.4), (0, 7.4), (-2.6, 6.4), (-4.5, 4.0)), 11.0).turned(90)
    cross = [box(0.1, 3.4, 0.2, (5.56, 0, z)) for z in (0.1, 3.0)] + [
        box(0.1, 0.2, 3.1, (5.56, y, 0.1)) for y in (-1.6, 0, 1.6)
    ]
    diagonals = [rod((5.57, -1.6, 0.2), (5.57, 0, 3.0), 0.08), rod((5.57, 1.6, 0.2), (5.57, 0, 3.0), 0.08)]
    slopes = [((4.7, 3.9), (2.65, 6.5)), ((2.65, 6.5), (0.0, 7.55))]
    roofs = [
        quad(((-5.8, -y0, z0), (5.8, -y0, z0), (5.8, -y1, z1), (-5.8, -y1, z1)), (11, 3))
        for (y0, z0), (y1, z1) in slopes
    ]
    roofs += [
        quad(((5.8, y0, z0), (-5.8, y0, z0), (-5.8, y1, z1), (5.8, y1, z1)), (11, 3)) for (y0, z0), (y1, z1) in slopes
    ]
    return [
        part(boards, end),
        part("slate roof", *roofs),
        part("dark wood", box(0.06, 3.3, 3.1, (5.52, 0, 0.05))),
        part("paint", *cross, *diagonals),
        part("paint", box(0.12, 1.2, 1.2, (5.52, 0, 4.5))),
        part("dark glass", box(0.14, 1.0, 1.0, (5.53, 0, 4.6))),
    ]


def shed(s: Style) -> Parts:
    return [
        part("planks", box(2.2, 2.8, 2.0), tint=s.tint if s.colour else (1, 1, 1)),
        part("slate roof", _gable(2.2, 2.8, 2.0, 0.8, 0.2)),
        part("dark wood", box(0.08, 0.9, 1.8, (1.1, -0.5, 0))),
        part("glass", box(0.06, 0.7, 0.6, (1.1, 0.7, 1.0))),
        part("paint", *(box(0.08, 0.8, 0.06, (1.1, 0.7, z)) for z in (0.96, 1.6))),
    ]


def greenhouse(s: Style) -> Parts:
    deep, wide, high = 3.6, 5.4, 2.1
    ribs = [box(0.07, 0.07, high, (x, y, 0)) for x in (-deep / 2, deep / 2) for y in (-2.7, -1.35, 0, 1.35, 2.7)]
    beams = [box(0.07, wide, 0.07, (x, 0, z)) for x in (-deep / 2, deep / 2) for z in (0.7, high)] + [
        box(0.07, wide, 0.08, (0, 0, high + 1.15))
    ]
    rafters = [
        rod((x, y, high), (0, y, high + 1.2), 0.035) for x in (-deep / 2, deep / 2) for y in (-2.7, -1.35, 0, 1.35, 2.7)
    ]
    plants = [cylinder(0.25, 0.9, (x, y, 0.2), top=0.32) for x in (-1.1, 1.1) for y in (-2, -1, 0, 1, 2)]
    back = [
        sheet(0.1, wide, (-deep / 2, 0, 0.2)),
        box(0.02, wide, high, (-deep / 2 - 0.02, 0, 0)),
        box(deep, 0.02, high, (0, -wide / 2, 0)),
    ]
    return [
        part("paint", *ribs, *beams, *rafters),
        part("brick", box(0.15, wide, 0.4, (deep / 2, 0, 0)), box(deep, 0.15, 0.4, (0, wide / 2, 0))),
        part(
            "glass",
            *back,
            quad(
                (
                    (-deep / 2, wide / 2, high),
                    (-deep / 2, -wide / 2, high),
                    (0, -wide / 2, high + 1.15),
                    (0, wide / 2, high + 1.15),
                )
            ),
        ),
        part("greens", *plants),
    ]


def silo(s: Style) -> Parts:
    return [
        part("corrugated", cylinder(1.7, 7.5, sides=20), tint=s.tint if s.colour else (1, 1, 1)),
        part("steel", lathe(((1.75, 7.5), (0.9, 8.6), (0, 8.8)), sides=20)),
        part(
            "iron",
            *(box(0.05, 0.5, 0.05, (1.75, 0, 0.5 + 0.45 * i)) for i in range(15)),
            *(box(0.05, 0.05, 7.0, (1.76, y, 0.3)) for y in (-0.25, 0.25)),
        ),
    ]


def windmill(s: Style) -> Parts:
    if s.shape == 1:  # a wind turbine
        blades = [box(0.12, 0.5, 6.0, (0, 0, 0)).turned(a, "x").moved(1.0, 0, 14.0) for a in (20, 140, 260)]
        return [
            part(
                "paint", cylinder(0.7, 14.0, top=0.35), box(2.0, 0.8, 0.8, (0, 0, 13.6)), *blades, tint=PALETTE["white"]
            ),
            part("steel", cylinder(0.35, 0.4).turned(90, "y").moved(0.9, 0, 14.0)),
        ]
    arms = []
    for a in (45, 135, 225, 315):
        arms += [box(0.12, 0.16, 4.6, (0, 0, 0)).turned(a, "x").moved(2.4, 0, 7.0)]
        arms += [box(0.06, 0.9, 3.4, (0, 0.5, 1.0)).turned(a, "x").moved(2.4, 0, 7.0)]
    return [
        part("plaster", cylinder(2.6, 7.0, top=1.8)),
        part("slate roof", lathe(((2.0, 7.0), (1.6, 8.0), (0, 8.8)))),
        part("slats", *arms),
        part("dark wood", box(0.3, 0.9, 1.9, (2.45, 0, 0)), rod((1.4, 0, 7.0), (2.6, 0, 7.0), 0.25)),
        part("dark glass", *(box(0.3, 0.6, 0.7, (2.1, y, 3.6)) for y in (-0.6, 0.6))),
    ]


def garage(s: Style) -> Parts:
    return [
        part("brick", box(5.5, 3.4, 2.7)),
        part("slats", box(0.08, 2.7, 2.2, (2.76, 0, 0)), tint=s.tint),
        part("concrete", box(5.8, 3.7, 0.2, (0, 0, 2.7))),
    ]


def bandstand(s: Style) -> Parts:
    posts = [
        cylinder(0.08, 2.6, (2.2 * math.cos(t), 2.2 * math.sin(t), 0.6))
        for t in (math.pi / 8 + i * math.pi / 4 for i in range(8))
    ]
    return [
        part("stone", cylinder(2.8, 0.6, sides=8)),
        part("paint", *posts, cylinder(2.6, 0.2, (0, 0, 3.2), sides=8), tint=PALETTE["white"]),
        part("paint", lathe(((2.9, 3.4), (1.2, 4.3), (0.2, 4.9), (0, 5.6)), sides=8), tint=s.tint),
    ]


def pond(s: Style) -> Parts:
    stones = [
        cylinder(0.32, 0.22, (3.0 * math.cos(t), 2.2 * math.sin(t), 0), top=0.22, sides=7)
        for t in (i * math.pi / 11 for i in range(22))
    ]
    reeds = [
        rod(
            (2.4 * math.cos(t), 1.7 * math.sin(t), 0),
            (2.45 * math.cos(t), 1.75 * math.sin(t), 0.9 + 0.3 * (i % 3)),
            0.03,
            5,
        )
        for i, t in enumerate((0.2, 0.3, 0.42, 0.5, 2.6, 2.7, 2.82, 2.9))
    ]
    lilies = [cylinder(0.25, 0.03, (x, y, 0.12), sides=9) for x, y in ((-0.8, 0.5), (0.4, -0.9), (-1.3, -0.4))]
    return [
        part(
            "water",
            lathe(((1.0, 0.1), (0.0, 0.1)), sides=22).scaled(2.9, 2.1, 1.0).moved(0, 0, 0.0),
            cylinder(1.0, 0.1, sides=22).scaled(2.9, 2.1, 1.0),
        ),
        part("stone", *stones),
        part("foliage", *reeds, *lilies),
    ]


BUILDERS = (
    house,
    shop,
    apartment_block,
    office_tower,
    church,
    barn,
    shed,
    greenhouse,
    silo,
    windmill,
    garage,
    bandstand,
    pond,
)
