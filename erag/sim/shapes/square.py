"""What stands in squares and parks."""

from __future__ import annotations

import math

from erag.sim.mesh import Mesh, bars, box, cylinder, lathe, panel, prism, rod, sphere
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def fountain(s: Style) -> Parts:
    basin = [
        lathe(((1.9, 0), (1.9, 0.5), (1.65, 0.5), (1.65, 0.35))),
        lathe(((0.3, 0.3), (0.2, 1.0), (0.9, 1.2), (0.9, 1.32), (0.7, 1.3))),
        cylinder(0.12, 0.7, (0, 0, 1.2), top=0.07),
    ]
    if s.shape == 1:
        basin.append(lathe(((0.1, 1.6), (0.5, 1.85), (0.5, 1.93), (0.4, 1.9))))
    jets = [
        lathe(((0.05, 1.9), (0.12, 2.4), (0.02, 2.6)), sides=6),
        *(
            bars(
                tuple((r * math.cos(t), r * math.sin(t), z) for r, z in ((0.1, 2.3), (0.45, 2.2), (0.7, 1.35))),
                0.025,
                5,
            )
            for t in (0.3, 1.9, 3.5, 5.1)
        ),
    ]
    return [
        part("stone" if s.shape == 0 else "marble", *basin),
        part("water", cylinder(1.7, 0.4), cylinder(0.8, 0.02, (0, 0, 1.28))),
        part("paint", *jets, tint=(0.82, 0.92, 1.0)),
    ]


def statue(s: Style) -> Parts:
    material = ("bronze", "marble", "stone")[s.shape % 3]
    base = [box(1.1, 1.1, 0.25), box(0.85, 0.85, 1.0, (0, 0, 0.25)), box(1.0, 1.0, 0.12, (0, 0, 1.25))]
    body = [
        rod((0, -0.13, 1.37), (0, -0.12, 2.1), 0.11),
        rod((0.1, 0.13, 1.37), (0, 0.12, 2.1), 0.11),
        lathe(((0.2, 2.0), (0.24, 2.3), (0.3, 2.7), (0.1, 2.85), (0.09, 2.95))),
        sphere(0.17, (0, 0, 3.08), (0.95, 0.9, 1.15)),
    ]
    arms = [
        rod((0, -0.28, 2.7), (0.1, -0.4, 2.2), 0.075),
        bars(((0, 0.28, 2.7), (0.2, 0.45, 2.9), (0.45, 0.5, 3.3)), 0.075),
    ]
    cloak = [lathe(((0.36, 1.45), (0.26, 2.2)), sides=10)]
    return [
        part("stone", *base),
        part(material, *body, *arms, *cloak),
        part(
            "picture",
            panel(0.5, 0.3, (0.43, 0, 0.6)),
            picture=Picture("lines", s.text or "1848", (0.3, 0.25, 0.1), (0.8, 0.72, 0.5), 1.6),
        ),
    ]


def planter(s: Style) -> Parts:
    pot = box(0.8, 1.5, 0.55) if s.shape == 1 else lathe(((0.4, 0), (0.6, 0.5), (0.65, 0.52), (0.65, 0.6), (0.5, 0.58)))
    bloom = [
        sphere(0.22, (x, y, 0.68)) for x, y in ((0.2, 0.2), (-0.25, 0.1), (0.05, -0.25), (-0.1, 0.3), (0.25, -0.1))
    ]
    if s.shape == 1:
        bloom = [sphere(0.26, (0.1 * (-1) ** i, -0.55 + 0.22 * i, 0.6)) for i in range(6)]
    return [
        part("planks" if s.shape == 1 else "stone", pot, tint=s.tint if s.shape == 1 else (1, 1, 1)),
        part("soil", cylinder(0.3, 0.02, (0, 0, 0.56))),
        part("blossom red" if s.seed % 2 else "blossom blue", *bloom),
    ]


def picnic_table(s: Style) -> Parts:
    top = [box(0.15, 1.9, 0.05, (x, 0, 0.72)) for x in (-0.32, -0.16, 0.0, 0.16, 0.32)]
    seats = [box(0.26, 1.9, 0.05, (x, 0, 0.44)) for x in (-0.75, 0.75)]
    legs = [rod((sx * 0.6, y, 0), (sx * 0.15, y, 0.72), 0.05) for sx in (-1, 1) for y in (-0.7, 0.7)] + [
        box(1.6, 0.08, 0.1, (0, y, 0.34)) for y in (-0.7, 0.7)
    ]
    return [part("planks", *top, *seats, tint=s.tint), part("wood", *legs)]


def parasol_table(s: Style) -> Parts:
    chairs: list[Mesh] = []
    for t in (45, 135, 225, 315):
        one = [
            box(0.4, 0.4, 0.05, (0.85, 0, 0.43)),
            box(0.05, 0.4, 0.45, (1.05, 0, 0.46)),
            *(box(0.04, 0.04, 0.43, (x, y, 0)) for x in (0.67, 1.03) for y in (-0.18, 0.18)),
        ]
        chairs += [m.turned(t) for m in one]
    return [
        part("steel", cylinder(0.04, 2.5), cylinder(0.3, 0.06)),
        part("pale wood", cylinder(0.5, 0.05, (0, 0, 0.7))),
        part(
            "cloth",
            lathe(((1.5, 2.05), (0.7, 2.4), (0, 2.6)), sides=8),
            lathe(((0, 2.35), (1.5, 2.03)), sides=8),
            tint=s.tint,
        ),
        part("wood", *chairs),
    ]


def market_stall(s: Style) -> Parts:
    posts = [cylinder(0.04, 2.3, (x, y, 0)) for x in (-0.9, 0.9) for y in (-1.4, 1.4)]
    roof = prism(((-1.3, 2.2), (1.3, 2.2), (0, 2.9)), 3.2)
    crates = [
        part(
            ("apples", "oranges", "greens", "pumpkin")[i % 4], sphere(0.3, (0.35, -1.05 + 0.7 * i, 0.98), (1, 1, 0.45))
        )
        for i in range(4)
    ]
    boxes = [box(0.7, 0.66, 0.16, (0.35, -1.05 + 0.7 * i, 0.86)) for i in range(4)]
    return [
        part("wood", *posts, box(1.5, 2.9, 0.08, (0, 0, 0.8))),
        part("awning held" if s.shape else "awning", roof),
        part("cloth", box(0.04, 2.9, 0.8, (0.74, 0, 0.0)), tint=s.tint),
        part("rough wood", *boxes),
        *crates,
    ]


def kiosk(s: Style) -> Parts:
    return [
        part(
            "slats",
            box(2.2, 2.6, 1.1),
            box(2.2, 0.4, 1.2, (0, -1.1, 1.1)),
            box(2.2, 0.4, 1.2, (0, 1.1, 1.1)),
            box(0.2, 2.6, 1.2, (-1.0, 0, 1.1)),
            tint=s.tint,
        ),
        part("goods", box(0.1, 1.8, 1.1, (-0.8, 0, 1.1))),
        part("wood", box(0.5, 2.0, 0.06, (1.1, 0, 1.08))),
        part("paint", box(2.7, 3.0, 0.16, (0.1, 0, 2.3)), tint=PALETTE["white"]),
        part("awning", prism(((1.1, 2.3), (1.9, 1.95), (1.9, 2.0), (1.1, 2.36)), 2.4)),
        part(
            "picture",
            panel(2.4, 0.5, (1.2, 0, 2.46)),
            picture=Picture("text", s.text or "KIOSK", (1, 1, 1), s.tint, 4.8),
        ),
    ]


def street_clock(s: Style) -> Parts:
    face = Picture("clock", seed=s.seed)
    return [
        part("iron", cylinder(0.2, 0.4, top=0.1), cylinder(0.07, 3.2), tint=s.tint),
        part("iron", cylinder(0.5, 0.24, (0, 0, -0.12), sides=20).turned(90, "y").moved(0, 0, 3.6)),
        part("lit picture", panel(0.72, 0.72, (0.13, 0, 3.24)), panel(0.72, 0.72, (-0.13, 0, 3.24), 180), picture=face),
    ]


BUILDERS = (
    fountain,
    statue,
    planter,
    picnic_table,
    parasol_table,
    market_stall,
    kiosk,
    street_clock,
)
