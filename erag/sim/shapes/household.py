"""Appliances, sanitary ware, and what hangs on walls or lies about at home and in offices."""

from __future__ import annotations

import math

from erag.sim.mesh import bars, blob, box, cylinder, lathe, panel, prism, rod, sheet, sphere
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def refrigerator(s: Style) -> Parts:
    doors = (
        [box(0.05, 0.64, 1.15, (0.32, 0, 0.6)), box(0.05, 0.64, 0.5, (0.32, 0, 0.06))]
        if s.shape == 0
        else [box(0.05, 0.44, 1.7, (0.32, y, 0.06)) for y in (-0.23, 0.23)]
    )
    handles = (
        [box(0.04, 0.03, 0.5, (0.37, -0.26, 0.75)), box(0.04, 0.03, 0.3, (0.37, -0.26, 0.2))]
        if s.shape == 0
        else [box(0.04, 0.03, 0.8, (0.37, y, 0.6)) for y in (-0.05, 0.05)]
    )
    return [
        part("metal", box(0.6, 0.68 if s.shape == 0 else 0.94, 1.8), *doors, tint=s.tint),
        part("iron", *handles, box(0.62, 0.66, 0.015, (0.04, 0, 0.57))),
    ]


def cooker(s: Style) -> Parts:
    rings = [cylinder(0.09, 0.015, (x, y, 0.88)) for x in (-0.14, 0.14) for y in (-0.15, 0.15)]
    knobs = [sphere(0.025, (0.31, y, 0.8)) for y in (-0.2, -0.1, 0, 0.1, 0.2)]
    pot = [cylinder(0.1, 0.14, (-0.14, 0.15, 0.9))]
    return [
        part("metal", box(0.6, 0.6, 0.88), tint=s.tint),
        part("iron", *rings, *knobs),
        part("dark glass", box(0.02, 0.46, 0.36, (0.3, 0, 0.22))),
        part("chrome", box(0.04, 0.5, 0.03, (0.33, 0, 0.66)), *pot),
    ]


def washing_machine(s: Style) -> Parts:
    return [
        part("paint", box(0.6, 0.6, 0.86), tint=s.tint),
        part("chrome", cylinder(0.22, 0.04, sides=20).turned(90, "y").moved(0.29, 0, 0.4)),
        part("dark glass", sphere(0.17, (0.32, 0, 0.4), (0.35, 1, 1), 16)),
        part("iron", box(0.02, 0.5, 0.03, (0.3, 0, 0.68)), sphere(0.04, (0.31, 0.16, 0.77))),
        part("screen", box(0.02, 0.14, 0.06, (0.3, -0.1, 0.74)), tint=(0.4, 0.7, 0.9)),
    ]


def kitchen_sink(s: Style) -> Parts:
    return [
        part("wood", box(0.6, 1.6, 0.84), tint=s.tint),
        part("stone", box(0.64, 1.64, 0.05, (0, 0, 0.84))),
        part("steel", box(0.4, 0.6, 0.015, (0.02, 0.2, 0.89))),
        part("iron", box(0.32, 0.5, 0.018, (0.02, 0.2, 0.89))),
        part("chrome", bars(((-0.22, 0.2, 0.88), (-0.22, 0.2, 1.2), (-0.05, 0.2, 1.25), (0.0, 0.2, 1.12)), 0.022)),
        part("brass", *(box(0.03, 0.12, 0.03, (0.31, y, 0.6)) for y in (-0.4, 0.2))),
    ]


def television(s: Style) -> Parts:
    stand = [part("wood", box(0.4, 1.5, 0.45), tint=PALETTE["brown"] if s.shape == 0 else PALETTE["white"])]
    return [
        *stand,
        part("rubber", box(0.06, 1.3, 0.76, (0, 0, 0.53)), box(0.2, 0.5, 0.04, (0, 0, 0.45))),
        part(
            "lit picture", panel(1.22, 0.68, (0.035, 0, 0.57)), picture=Picture("broadcast", aspect=1.78, seed=s.seed)
        ),
    ]


def computer(s: Style) -> Parts:
    screen = Picture("desktop", aspect=1.6, seed=s.seed)
    if s.shape == 1:  # a laptop
        return [
            part("steel", box(0.26, 0.36, 0.02), box(0.02, 0.36, 0.25, (-0.15, 0, 0.01))),
            part("rubber", box(0.12, 0.3, 0.005, (-0.02, 0, 0.02))),
            part("lit picture", panel(0.33, 0.21, (-0.135, 0, 0.035)), picture=screen),
        ]
    return [
        part(
            "rubber",
            box(0.03, 0.56, 0.36, (-0.1, 0, 0.12)),
            box(0.06, 0.08, 0.14, (-0.12, 0, 0)),
            box(0.18, 0.24, 0.015, (-0.1, 0, 0)),
        ),
        part("lit picture", panel(0.52, 0.32, (-0.083, 0, 0.14)), picture=screen),
        part(
            "plastic", box(0.15, 0.42, 0.02, (0.2, 0, 0)), sphere(0.035, (0.2, 0.3, 0.015), (1.3, 1, 0.5)), tint=s.tint
        ),
    ]


def printer(s: Style) -> Parts:
    return [
        part("plastic", box(0.6, 0.6, 0.7), box(0.66, 0.64, 0.25, (0, 0, 0.75)), tint=s.tint),
        part(
            "rubber",
            box(0.04, 0.5, 0.1, (0.3, 0, 0.62)),
            box(0.02, 0.5, 0.02, (0.3, 0, 0.35)),
            box(0.02, 0.5, 0.02, (0.3, 0, 0.18)),
        ),
        part("paper", box(0.3, 0.4, 0.04, (0.3, 0, 0.7)), box(0.3, 0.3, 0.02, (-0.1, 0, 1.0))),
        part("screen", box(0.12, 0.18, 0.02, (0.26, -0.2, 1.0)), tint=(0.4, 0.75, 0.95)),
        part("plastic", box(0.5, 0.55, 0.08, (-0.02, 0, 1.0)), tint=PALETTE["grey"]),
    ]


def microwave(s: Style) -> Parts:
    return [
        part("metal", box(0.38, 0.52, 0.3), tint=s.tint),
        part("dark glass", box(0.02, 0.34, 0.2, (0.19, -0.06, 0.05))),
        part("screen", box(0.02, 0.09, 0.05, (0.19, 0.19, 0.2)), tint=(0.3, 0.9, 0.4)),
        part("iron", *(box(0.02, 0.07, 0.02, (0.19, 0.19, z)) for z in (0.05, 0.09, 0.13))),
    ]


def coffee_machine(s: Style) -> Parts:
    return [
        part(
            "metal",
            box(0.34, 0.3, 0.1),
            box(0.14, 0.3, 0.5, (-0.1, 0, 0)),
            box(0.34, 0.3, 0.14, (0, 0, 0.42)),
            tint=s.tint,
        ),
        part("iron", cylinder(0.04, 0.06, (0.06, 0, 0.36)), box(0.2, 0.24, 0.015, (0.06, 0, 0.1))),
        part(
            "paint",
            cylinder(0.04, 0.08, (0.06, 0, 0.115)),
            cylinder(0.05, 0.1, (-0.06, 0.08, 0.56)),
            cylinder(0.05, 0.1, (-0.06, -0.06, 0.56)),
        ),
        part("lamp", sphere(0.02, (0.17, 0.08, 0.5)), tint=(1, 0.2, 0.1)),
    ]


def water_cooler(s: Style) -> Parts:
    return [
        part("plastic", box(0.34, 0.34, 1.0), tint=PALETTE["white"]),
        part("glass", lathe(((0.1, 1.0), (0.14, 1.08), (0.14, 1.4), (0.0, 1.44))), tint=(0.6, 0.9, 1.3)),
        part("rubber", box(0.04, 0.22, 0.2, (0.16, 0, 0.66))),
        part("plastic", box(0.06, 0.04, 0.05, (0.2, -0.06, 0.82)), tint=PALETTE["blue"]),
        part("plastic", box(0.06, 0.04, 0.05, (0.2, 0.06, 0.82)), tint=PALETTE["red"]),
    ]


def vending_machine(s: Style) -> Parts:
    return [
        part("paint", box(0.8, 0.95, 1.85), tint=s.tint),
        part(
            "lit picture",
            panel(0.9, 1.75, (0.41, 0, 0.05)),
            picture=Picture("vending", s.text, ground=s.tint, aspect=0.52, seed=s.seed),
        ),
    ]


def toilet(s: Style) -> Parts:
    bowl = lathe(((0.14, 0), (0.12, 0.16), (0.2, 0.36), (0.22, 0.4))).scaled(1.25, 1, 1)
    return [
        part(
            "paint",
            bowl.moved(0.08),
            cylinder(0.22, 0.03, (0.06, 0, 0.4)).scaled(1.25, 1, 1),
            box(0.2, 0.44, 0.42, (-0.28, 0, 0.4)),
            box(0.24, 0.48, 0.04, (-0.28, 0, 0.8)),
            box(0.2, 0.24, 0.4, (-0.24, 0, 0)),
            tint=PALETTE["white"],
        ),
        part("dark glass", cylinder(0.12, 0.01, (0.1, 0, 0.43)).scaled(1.3, 1, 1)),
        part("chrome", box(0.03, 0.1, 0.03, (-0.17, -0.14, 0.74))),
    ]


def bathtub(s: Style) -> Parts:
    return [
        part(
            "paint",
            box(1.7, 0.1, 0.56, (0, -0.35, 0)),
            box(1.7, 0.1, 0.56, (0, 0.35, 0)),
            box(0.14, 0.8, 0.56, (-0.8, 0, 0)),
            box(0.14, 0.8, 0.56, (0.8, 0, 0)),
            box(1.5, 0.64, 0.2),
            tint=PALETTE["white"],
        ),
        part("water", sheet(1.5, 0.62, (0, 0, 0.42)), tint=(1.6, 1.4, 1.3)),
        part(
            "chrome",
            bars(((-0.82, 0, 0.55), (-0.82, 0, 0.78), (-0.66, 0, 0.78), (-0.64, 0, 0.7)), 0.025),
            *(sphere(0.035, (-0.8, y, 0.62)) for y in (-0.14, 0.14)),
        ),
    ]


def washbasin(s: Style) -> Parts:
    return [
        part(
            "paint",
            lathe(((0.1, 0), (0.08, 0.6))),
            lathe(((0.1, 0.6), (0.28, 0.74), (0.3, 0.84), (0.24, 0.84), (0.16, 0.74), (0, 0.72))),
            box(0.12, 0.56, 0.2, (-0.25, 0, 0.68)),
            tint=PALETTE["white"],
        ),
        part(
            "chrome",
            bars(((-0.22, 0, 0.86), (-0.22, 0, 1.02), (-0.06, 0, 1.0)), 0.022),
            *(sphere(0.03, (-0.24, y, 0.92)) for y in (-0.12, 0.12)),
        ),
    ]


def wall_clock(s: Style) -> Parts:
    return [
        part("plastic", cylinder(0.2, 0.05, sides=20).turned(90, "y").moved(0, 0, 0.2), tint=s.tint),
        part("picture", panel(0.36, 0.36, (0.052, 0, 0.02)), picture=Picture("clock", ground=s.tint, seed=s.seed)),
    ]


def painting(s: Style) -> Parts:
    motif = ("landscape", "portrait", "abstract")[s.shape % 3]
    w, h = (1.3, 0.95) if motif == "landscape" else (0.9, 1.15) if motif == "portrait" else (1.2, 1.2)
    return [
        part("brass" if s.shape != 2 else "iron", box(0.05, w + 0.08, h + 0.08)),
        part("picture", panel(w, h, (0.03, 0, 0.04)), picture=Picture(motif, aspect=w / h, seed=s.seed)),
    ]


def mirror(s: Style) -> Parts:
    if s.shape == 1:
        return [
            part("brass", cylinder(0.42, 0.04, sides=24).turned(90, "y").moved(0, 0, 0.42)),
            part("mirror", cylinder(0.37, 0.05, sides=24).turned(90, "y").moved(0, 0, 0.42)),
        ]
    return [
        part("wood", box(0.05, 0.7, 1.2), tint=s.tint),
        part("mirror", box(0.06, 0.6, 1.1, (0, 0, 0.05))),
        part(
            "paint",
            rod((0.035, -0.2, 0.5), (0.035, 0.1, 1.0), 0.012),
            rod((0.035, -0.05, 0.4), (0.035, 0.2, 0.8), 0.012),
        ),
    ]


def vase(s: Style) -> Parts:
    stems = [
        rod((0, 0, 0.2), (0.12 * math.cos(t), 0.12 * math.sin(t), 0.52), 0.01, 5) for t in (0.2, 1.5, 2.8, 4.1, 5.4)
    ]
    heads = [blob(0.065, (0.13 * math.cos(t), 0.13 * math.sin(t), 0.55), s.rng) for t in (0.2, 1.5, 2.8, 4.1, 5.4)]
    return [
        part("paint", lathe(((0.07, 0), (0.12, 0.1), (0.1, 0.22), (0.05, 0.28), (0.08, 0.32))), tint=s.tint),
        part("foliage", *stems),
        part("blossom red", *heads),
    ]


def rug(s: Style) -> Parts:
    return [part("rug held" if s.shape == 1 else "rug", sheet(1.8, 2.6, (0, 0, 0.015), fit=True))]


def whiteboard(s: Style) -> Parts:
    chalk = s.shape == 1
    picture = Picture(
        "board",
        s.text,
        (0.95, 0.95, 0.9) if chalk else (0.1, 0.2, 0.6),
        (0.12, 0.28, 0.2) if chalk else (0.97, 0.97, 0.97),
        2.0,
        s.seed,
    )
    return [
        part("steel", box(0.05, 2.06, 1.06), box(0.12, 1.6, 0.04, (0.04, 0, -0.02))),
        part("picture", panel(2.0, 1.0, (0.03, 0, 0.03)), picture=picture),
    ]


def fireplace(s: Style) -> Parts:
    hearth = "brick" if s.shape == 0 else "marble"
    flames = [
        blob(0.09, (0.12, y, z), s.rng).scaled(1, 1, 1.0)
        for y, z in ((-0.18, 0.3), (0, 0.42), (0.16, 0.32), (-0.05, 0.28), (0.1, 0.25))
    ]
    return [
        part(
            hearth,
            box(0.4, 0.35, 1.1, (0, -0.6, 0)),
            box(0.4, 0.35, 1.1, (0, 0.6, 0)),
            box(0.4, 1.5, 0.35, (0, 0, 0.85)),
            box(0.6, 1.7, 0.06),
        ),
        part("dark wood", box(0.5, 1.8, 0.1, (0, 0, 1.2))),
        part("rubber", box(0.1, 0.9, 0.85, (-0.14, 0, 0.05))),
        part("bark", *(rod((0.1, -0.3, 0.12 + 0.06 * i), (0.12, 0.3, 0.14 + 0.05 * i), 0.06) for i in range(2))),
        part("lamp", *flames, tint=(1, 0.55, 0.1)),
    ]


def piano(s: Style) -> Parts:
    picture = Picture("keys", aspect=4)
    if s.shape == 1:  # a grand piano
        body = prism(((-1.0, 0), (0.5, 0), (0.5, 0.3), (-1.0, 0.3)), 1.4).moved(0, 0, 0.65)
        lid = prism(((-1.0, 0.0), (0.3, 0.0), (0.3, 0.05), (-1.0, 0.05)), 1.4).turned(38, "x").moved(0, 0.12, 1.42)
        return [
            part(
                "paint",
                body,
                lid,
                *(cylinder(0.07, 0.65, at) for at in ((-0.85, 0, 0), (0.35, 0.55, 0), (0.35, -0.55, 0))),
                box(0.3, 1.4, 0.12, (0.62, 0, 0.66)),
                box(0.35, 0.8, 0.08, (1.15, 0, 0.44)),
                *(box(0.05, 0.05, 0.45, (x, y, 0)) for x in (1.02, 1.28) for y in (-0.35, 0.35)),
                tint=s.tint,
            ),
            part("picture", sheet(1.3, 0.22, fit=True).turned(90).moved(0.64, 0, 0.79), picture=picture),
        ]
    return [
        part(
            "paint",
            box(0.5, 1.45, 1.2),
            box(0.34, 1.45, 0.1, (0.36, 0, 0.66)),
            *(box(0.08, 0.08, 0.66, (0.46, y, 0)) for y in (-0.66, 0.66)),
            box(0.32, 0.8, 0.07, (0.85, 0, 0.46)),
            *(box(0.05, 0.05, 0.46, (x, y, 0)) for x in (0.74, 0.96) for y in (-0.34, 0.34)),
            tint=s.tint,
        ),
        part("picture", sheet(1.36, 0.22, fit=True).turned(90).moved(0.4, 0, 0.77), picture=picture),
        part("paper", box(0.02, 0.4, 0.26, (0.27, 0, 0.84))),
    ]


BUILDERS = (
    refrigerator,
    cooker,
    washing_machine,
    kitchen_sink,
    television,
    computer,
    printer,
    microwave,
    coffee_machine,
    water_cooler,
    vending_machine,
    toilet,
    bathtub,
    washbasin,
    wall_clock,
    painting,
    mirror,
    vase,
    rug,
    whiteboard,
    fireplace,
    piano,
)
