"""Playgrounds, sport, people and animals."""

from __future__ import annotations

import math

from erag.sim.mesh import bars, box, cylinder, lathe, panel, prism, rod, sheet, sphere
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def swing(s: Style) -> Parts:
    frame = [rod((x, y, 0), (0, y * 0.9, 2.4), 0.05) for x in (-0.8, 0.8) for y in (-1.7, 1.7)] + [
        rod((0, -1.6, 2.4), (0, 1.6, 2.4), 0.05)
    ]
    seats = [box(0.25, 0.5, 0.05, (0, y, 0.5)) for y in (-0.7, 0.7)]
    chains = [rod((0, y + d, 0.5), (0, y + d, 2.4), 0.012, 5) for y in (-0.7, 0.7) for d in (-0.23, 0.23)]
    return [
        part("paint" if s.shape == 0 else "planks", *frame, tint=s.tint),
        part("rubber", *seats),
        part("iron", *chains),
    ]


def slide(s: Style) -> Parts:
    chute = prism(((-0.2, 1.75), (1.6, 0.35), (2.1, 0.3), (2.1, 0.38), (1.62, 0.44), (-0.2, 1.85)), 0.55)
    sides = [bars(((-0.2, y, 1.95), (1.6, y, 0.55), (2.1, y, 0.45)), 0.05) for y in (-0.3, 0.3)]
    tower = [box(0.09, 0.09, 2.5, (x, y, 0)) for x in (-1.1, -0.3) for y in (-0.4, 0.4)]
    rungs = [box(0.06, 0.7, 0.05, (-1.15 - 0.1 * (5 - i) * 0.5, 0, 0.3 * i)) for i in range(1, 6)]
    roof = (
        [part("paint", lathe(((0.85, 2.5), (0, 3.1)), (-0.7, 0, 0), sides=4), tint=PALETTE["blue"])]
        if s.shape == 1
        else []
    )
    return [
        part("plastic", chute, *sides, tint=s.tint),
        part("wood", *tower, *rungs, box(0.9, 0.9, 0.08, (-0.7, 0, 1.7))),
        *roof,
    ]


def seesaw(s: Style) -> Parts:
    beam = [box(3.2, 0.2, 0.1).turned(10, "y").moved(0, 0, 0.5)]
    handles = [rod((x, -0.2, z), (x, 0.2, z), 0.025) for x, z in ((-1.15, 1.0), (1.15, 0.58))] + [
        rod((x, 0, z - 0.3), (x, 0, z), 0.025) for x, z in ((-1.15, 1.0), (1.15, 0.58))
    ]
    return [part("paint", *beam, tint=s.tint), part("iron", *handles, prism(((-0.3, 0), (0.3, 0), (0, 0.55)), 0.3))]


def sandpit(s: Style) -> Parts:
    rim = [box(0.2, 3.0, 0.3, (x, 0, 0)) for x in (-1.5, 1.5)] + [box(3.0, 0.2, 0.3, (0, y, 0)) for y in (-1.4, 1.4)]
    return [
        part("wood", *rim),
        part("sand", box(2.9, 2.8, 0.16), cylinder(0.5, 0.3, (0.4, 0.3, 0.14), top=0.05)),
        part("plastic", cylinder(0.1, 0.2, (-0.6, -0.4, 0.16), top=0.14), tint=PALETTE["red"]),
        part("plastic", box(0.3, 0.12, 0.03, (-0.3, -0.7, 0.17)), tint=PALETTE["blue"]),
    ]


def climbing_frame(s: Style) -> Parts:
    if s.shape == 1:  # a dome
        rings = [
            [(r * math.cos(t), r * math.sin(t), z) for t in (i * math.pi / 4 for i in range(9))]
            for r, z in ((1.7, 0.0), (1.5, 0.8), (0.9, 1.5))
        ]
        spokes = [bars([ring_[i] for ring_ in rings] + [(0, 0, 1.75)], 0.03) for i in range(8)]
        return [part("paint", *(bars(r, 0.03) for r in rings), *spokes, tint=s.tint)]
    uprights = [rod((x, y, 0), (x, y, 2.1), 0.035) for x in (-1.2, 0, 1.2) for y in (-0.8, 0.8)]
    rails = [rod((-1.2, y, z), (1.2, y, z), 0.03) for y in (-0.8, 0.8) for z in (0.7, 1.4, 2.1)] + [
        rod((x, -0.8, z), (x, 0.8, z), 0.03) for x in (-1.2, -0.6, 0, 0.6, 1.2) for z in (1.4, 2.1)
    ]
    return [part("paint", *uprights, tint=s.tint), part("paint", *rails, tint=PALETTE["yellow"])]


def football_goal(s: Style) -> Parts:
    frame = [
        rod((0, -2.4, 0), (0, -2.4, 2.1), 0.06),
        rod((0, 2.4, 0), (0, 2.4, 2.1), 0.06),
        rod((0, -2.4, 2.1), (0, 2.4, 2.1), 0.06),
    ]
    net = [sheet(1.0, 4.8, (0, 0, 0)).turned(-115, "y").moved(-1.0, 0, 0.0)]
    strings = [rod((0, y, 2.1), (-1.3, y, 0), 0.012, 4) for y in (-2.4 + 0.4 * i for i in range(13))] + [
        rod((-1.3 * t, -2.4, 2.1 * (1 - t)), (-1.3 * t, 2.4, 2.1 * (1 - t)), 0.012, 4)
        for t in (0.15 * i for i in range(1, 7))
    ]
    del net
    ball = [part("paint", sphere(0.16, (1.6, 0.8, 0.16)))]
    return [part("paint", *frame, *strings, *(rod((-1.3, y, 0), (0, y, 0), 0.04) for y in (-2.4, 2.4))), *ball]


def basketball_hoop(s: Style) -> Parts:
    rim = [
        bars(
            [(0.75 + 0.24 * math.cos(t), 0.24 * math.sin(t), 2.9) for t in (i * math.pi / 6 for i in range(13))], 0.022
        )
    ]
    net = [
        rod(
            (0.75 + 0.23 * math.cos(t), 0.23 * math.sin(t), 2.9),
            (0.75 + 0.12 * math.cos(t), 0.12 * math.sin(t), 2.5),
            0.012,
            4,
        )
        for t in (i * math.pi / 5 for i in range(10))
    ]
    return [
        part("iron", cylinder(0.09, 3.3, (-0.5, 0, 0)), rod((-0.5, 0, 3.0), (0.4, 0, 3.1), 0.06)),
        part("paint", box(0.05, 1.5, 1.05, (0.43, 0, 2.75))),
        part(
            "paint",
            box(0.02, 0.5, 0.04, (0.46, 0, 3.3)),
            box(0.02, 0.5, 0.04, (0.46, 0, 2.95)),
            *(box(0.02, 0.04, 0.39, (0.46, y, 2.95)) for y in (-0.25, 0.25)),
            *rim,
            tint=s.tint,
        ),
        part("linen", *net),
    ]


def tennis_net(s: Style) -> Parts:
    return [
        part("net", box(0.03, 8.0, 0.85, (0, 0, 0.08)), tint=(0.8, 0.9, 0.8)),
        part("paint", box(0.05, 8.0, 0.09, (0, 0, 0.92))),
        part("paint", *(cylinder(0.06, 1.08, (0, y, 0)) for y in (-4.05, 4.05)), tint=s.tint),
    ]


def table_tennis_table(s: Style) -> Parts:
    return [
        part("paint", box(2.6, 1.5, 0.05, (0, 0, 0.72)), tint=s.tint),
        part(
            "markings",
            box(2.6, 0.03, 0.055, (0, 0, 0.72)),
            *(box(2.6, 0.03, 0.055, (0, y, 0.72)) for y in (-0.73, 0.73)),
            *(box(0.03, 1.5, 0.055, (x, 0, 0.72)) for x in (-1.28, 1.28)),
            box(0.03, 1.64, 0.16, (0, 0, 0.77)),
        ),
        part("iron", *(box(0.06, 0.06, 0.72, (x, y, 0)) for x in (-1.0, 1.0) for y in (-0.6, 0.6))),
    ]


def grandstand(s: Style) -> Parts:
    steps = [box(0.8, 8.0, 0.4 * (i + 1), (-0.8 * i, 0, 0)) for i in range(4)]
    seats = [
        box(0.4, 0.45, 0.08, (-0.8 * i - 0.1, -3.7 + 0.62 * j, 0.4 * (i + 1) + 0.12))
        for i in range(4)
        for j in range(13)
    ]
    backs = [
        box(0.06, 0.45, 0.35, (-0.8 * i - 0.3, -3.7 + 0.62 * j, 0.4 * (i + 1) + 0.12))
        for i in range(4)
        for j in range(13)
    ]
    return [part("concrete", *steps), part("plastic", *seats, *backs, tint=s.tint)]


def scoreboard(s: Style) -> Parts:
    text = s.text or f"HOME {s.seed % 5}   GUEST {s.seed // 5 % 4}"
    return [
        part("steel", *(cylinder(0.1, 2.4, (0, y, 0)) for y in (-1.2, 1.2))),
        part("iron", box(0.25, 3.4, 1.4, (0, 0, 2.2))),
        part(
            "lit picture",
            panel(3.2, 1.2, (0.13, 0, 2.3)),
            picture=Picture("bare", text, (1.0, 0.75, 0.1), (0.05, 0.07, 0.05), 2.7),
        ),
    ]


def person(s: Style) -> Parts:
    trousers = list(PALETTE.values())[(1, 6, 7, 9, 15)[s.seed % 5]]
    legs = [rod((0.06 * k, 0.1 * k, 0.05), (0, 0.09 * k, 0.86), 0.085) for k in (-1, 1)]
    arms = [bars(((0, 0.22 * k, 1.38), (0.08 * k, 0.29 * k, 1.1), (0.16, 0.28 * k, 0.9)), 0.055) for k in (-1, 1)]
    torso = lathe(((0.16, 0.82), (0.19, 1.1), (0.21, 1.36), (0.1, 1.47), (0, 1.49))).scaled(0.75, 1, 1)
    skin = ((1, 1, 1), (0.75, 0.66, 0.6), (0.5, 0.4, 0.34))[s.seed % 3]
    head = [sphere(0.115, (0.01, 0, 1.62), (1, 0.9, 1.15)), cylinder(0.05, 0.1, (0, 0, 1.45))]
    hair = sphere(0.122, (-0.025, 0, 1.66), (1, 0.95, 1.0))
    shoes = [box(0.26, 0.1, 0.08, (0.06 + 0.06 * k, 0.1 * k, 0)) for k in (-1, 1)]
    return [
        part("cloth", *legs, tint=trousers),
        part("cloth", torso, *arms, tint=s.tint),
        part("skin", *head, *(sphere(0.05, (0.17, 0.28 * k, 0.88)) for k in (-1, 1)), tint=skin),
        part("hair", hair),
        part("rubber", *shoes),
    ]


def dog(s: Style) -> Parts:
    legs = [rod((x, y, 0), (x, y, 0.34), 0.045) for x in (-0.26, 0.24) for y in (-0.1, 0.1)]
    return [
        part(
            "fur",
            sphere(0.2, (0, 0, 0.46), (1.9, 0.8, 0.85)),
            sphere(0.14, (0.42, 0, 0.68), (1.05, 0.9, 0.95)),
            sphere(0.08, (0.56, 0, 0.63), (1.3, 0.8, 0.7)),
            rod((0.28, 0, 0.5), (0.4, 0, 0.66), 0.09),
            rod((-0.36, 0, 0.52), (-0.55, 0, 0.74), 0.035),
            *legs,
            *(sphere(0.07, (0.38, y, 0.72), (0.5, 0.4, 1.3)) for y in (-0.12, 0.12)),
            tint=s.tint,
        ),
        part("rubber", sphere(0.03, (0.66, 0, 0.65)), *(sphere(0.018, (0.54, y, 0.72)) for y in (-0.06, 0.06))),
        part("paint", lathe(((0.1, 0.0), (0.1, 0.04))).turned(35, "y").moved(0.33, 0, 0.56), tint=RED),
    ]


RED = (0.8, 0.1, 0.1)


def cow(s: Style) -> Parts:
    hide = "brown hide" if s.shape == 1 else "cowhide"
    legs = [rod((x, y, 0), (x, y, 0.75), 0.09) for x in (-0.65, 0.6) for y in (-0.25, 0.25)]
    body = [
        sphere(0.5, (0, 0, 1.05), (1.9, 0.8, 0.85)),
        rod((0.7, 0, 1.1), (1.1, 0, 1.35), 0.2),
        sphere(0.22, (1.25, 0, 1.38), (1.3, 0.85, 0.95)),
        rod((-0.92, 0, 1.2), (-1.05, 0, 0.6), 0.03),
    ]
    return [
        part(hide, *body, *legs),
        part(
            "skin",
            sphere(0.14, (1.48, 0, 1.3), (0.9, 1, 0.8)),
            sphere(0.17, (-0.4, 0, 0.68), (1, 1, 0.7)),
            tint=(1, 0.8, 0.78),
        ),
        part("paper", *(rod((1.15, 0.12 * k, 1.52), (1.2, 0.26 * k, 1.7), 0.03) for k in (-1, 1))),
        part(
            "rubber",
            *(sphere(0.03, (1.42, 0.15 * k, 1.46)) for k in (-1, 1)),
            *(cylinder(0.1, 0.1, (x, y, 0)) for x in (-0.65, 0.6) for y in (-0.25, 0.25)),
        ),
        part("hair", *(sphere(0.1, (1.13, 0.26 * k, 1.45), (0.5, 1.2, 0.5)) for k in (-1, 1))),
    ]


def sheep(s: Style) -> Parts:
    fleece = [
        sphere(0.36, (0, 0, 0.66), (1.5, 0.95, 0.95)),
        *(sphere(0.2, (0.42 * math.cos(t), 0.24 * math.sin(t), 0.8)) for t in (0, 1, 2.1, 3.1, 4.2, 5.2)),
    ]
    face = [
        sphere(0.13, (0.68, 0, 0.84), (1.25, 0.8, 1.0)),
        *(sphere(0.06, (0.58, 0.15 * k, 0.9), (0.6, 1.3, 0.5)) for k in (-1, 1)),
        *(rod((x, y, 0), (x, y, 0.5), 0.05) for x in (-0.34, 0.32) for y in (-0.16, 0.16)),
    ]
    return [
        part("wool", *fleece, sphere(0.11, (0.6, 0, 0.97))),
        part("fur", *face, tint=PALETTE["black"] if s.shape == 0 else PALETTE["cream"]),
    ]


def scarecrow(s: Style) -> Parts:
    return [
        part("wood", rod((0, 0, 0), (0, 0, 1.9), 0.05), rod((0, -0.8, 1.45), (0, 0.8, 1.45), 0.04)),
        part(
            "cloth",
            prism(((-0.15, 0.75), (0.15, 0.75), (0.13, 1.5), (-0.13, 1.5)), 0.5),
            *(box(0.16, 0.5, 0.18, (0, 0.42 * k, 1.35)) for k in (-1, 1)),
            tint=s.tint,
        ),
        part(
            "straw",
            sphere(0.18, (0, 0, 1.72)),
            *(lathe(((0.12, 0), (0.03, 0.25))).turned(90 * k, "x").moved(0, 0.66 * k, 1.45) for k in (-1, 1)),
            cylinder(0.2, 0.2, (0, 0, 0.6)),
        ),
        part("dark wood", cylinder(0.34, 0.03, (0, 0, 1.84)), cylinder(0.18, 0.2, (0, 0, 1.86), top=0.13)),
        part("rubber", *(sphere(0.025, (0.17, y, 1.75)) for y in (-0.06, 0.06))),
    ]


def tent(s: Style) -> Parts:
    return [
        part("cloth", prism(((-1.1, 0), (1.1, 0), (0, 1.5)), 2.2).turned(90), tint=s.tint),
        part("rubber", prism(((-0.4, 0), (0.4, 0), (0, 1.1)), 0.02).turned(90).moved(1.11)),
        part("linen", *(rod((1.1, 0, 1.5), (1.9, y, 0), 0.012, 4) for y in (-0.5, 0.5))),
    ]


BUILDERS = (
    swing,
    slide,
    seesaw,
    sandpit,
    climbing_frame,
    football_goal,
    basketball_hoop,
    tennis_net,
    table_tennis_table,
    grandstand,
    scoreboard,
    person,
    dog,
    cow,
    sheep,
    scarecrow,
    tent,
)
