"""Plants, and what is made of them."""

from __future__ import annotations

import math

from erag.sim.mesh import blob, box, cylinder, lathe, rod, sphere
from erag.sim.model import Parts, Style, part


def tree(s: Style) -> Parts:
    h = s.rng.uniform(4.6, 6.4)
    if s.shape == 1:  # slender, pale bark
        crown = [blob(s.rng.uniform(0.9, 1.15), (0, 0, h * z), s.rng).scaled(1, 1, 1) for z in (0.5, 0.66, 0.82, 0.95)]
        return [part("birch bark", cylinder(0.13, h * 0.9, top=0.05)), part("leaves", *crown)]
    if s.shape == 2:  # a wide umbrella
        crown = [
            blob(1.2, (1.5 * math.cos(t), 1.5 * math.sin(t), h * 0.8), s.rng).scaled(1, 1, 0.9)
            for t in (0, 1.05, 2.1, 3.14, 4.2, 5.2)
        ]
        limbs = [rod((0, 0, h * 0.4), (1.2 * math.cos(t), 1.2 * math.sin(t), h * 0.72), 0.09) for t in (0.5, 2.6, 4.7)]
        return [
            part("bark", cylinder(0.28, h * 0.5, top=0.2), *limbs),
            part("leaves", *crown, blob(1.4, (0, 0, h * 0.82), s.rng)),
        ]
    crown = [blob(1.35, (0, 0, h * 0.72), s.rng)]
    for i in range(6):
        t = i * 1.05 + s.rng.uniform(0, 0.5)
        crown.append(
            blob(s.rng.uniform(0.8, 1.1), (math.cos(t) * 1.0, math.sin(t) * 1.0, h * s.rng.uniform(0.52, 0.85)), s.rng)
        )
    limbs = [rod((0, 0, h * 0.3), (math.cos(t) * 0.8, math.sin(t) * 0.8, h * 0.6), 0.08) for t in (0.4, 2.5, 4.4)]
    return [part("bark", cylinder(0.26, h * 0.6, top=0.14), *limbs), part("leaves", *crown)]


def conifer(s: Style) -> Parts:
    h = s.rng.uniform(4.5, 6.5)
    tiers = 5 if s.shape == 0 else 3
    cones = [
        cylinder(
            1.6 * (1 - i / (tiers + 0.6)), h * 1.35 / tiers, (0, 0, h * (0.14 + 0.8 * i / tiers)), top=0.05, sides=11
        )
        for i in range(tiers)
    ]
    return [part("bark", cylinder(0.18, h * 0.4)), part("evergreen", *cones)]


def hedge(s: Style) -> Parts:
    long = s.extent or 3.0
    lumps = [blob(0.42, (0, -long / 2 + 0.3 + i * (long - 0.6) / 6, 0.95), s.rng) for i in range(7)]
    return [part("hedge leaves", box(0.8, long, 1.15), *lumps)]


def shrub(s: Style) -> Parts:
    lumps = [
        blob(s.rng.uniform(0.36, 0.52), (0.4 * math.cos(t), 0.4 * math.sin(t), 0.42), s.rng)
        for t in (0.2, 1.5, 2.8, 4.0, 5.3)
    ]
    return [part("hedge leaves" if s.shape == 0 else "evergreen", *lumps, blob(0.55, (0, 0, 0.65), s.rng))]


def flower_bed(s: Style) -> Parts:
    bloom = "blossom blue" if s.colour in ("blue", "purple") else "blossom red"
    heads = [blob(0.22, (s.rng.uniform(-0.55, 0.55), s.rng.uniform(-1.1, 1.1), 0.3), s.rng) for _ in range(22)]
    if s.shape == 1:  # round
        heads = [
            blob(0.22, (r * math.cos(t), r * math.sin(t), 0.3), s.rng)
            for r, t in ((0.8 * (i / 22) ** 0.5, i * 2.4) for i in range(22))
        ]
        return [
            part("soil", cylinder(1.05, 0.16)),
            part("stone", lathe(((1.15, 0), (1.15, 0.2), (1.02, 0.2)))),
            part(bloom, *heads),
        ]
    return [
        part("soil", box(1.5, 2.6, 0.14)),
        part(
            "stone",
            box(0.1, 2.8, 0.2, (0.8, 0, 0)),
            box(0.1, 2.8, 0.2, (-0.8, 0, 0)),
            box(1.6, 0.1, 0.2, (0, 1.35, 0)),
            box(1.6, 0.1, 0.2, (0, -1.35, 0)),
        ),
        part(bloom, *heads),
    ]


def potted_plant(s: Style) -> Parts:
    if s.shape == 1:  # upright swords
        leaves = [
            rod((0, 0, 0.4), (0.25 * math.cos(t), 0.25 * math.sin(t), 1.15 + 0.15 * (i % 3)), 0.045, 5)
            for i, t in enumerate((0, 0.8, 1.7, 2.5, 3.3, 4.2, 5.0, 5.7))
        ]
    elif s.shape == 2:  # a ball on a stem
        leaves = [blob(0.36, (0, 0, 1.25), s.rng), rod((0, 0, 0.4), (0, 0, 1.0), 0.04)]
    else:
        leaves = [
            sphere(0.24, (0.3 * math.cos(t), 0.3 * math.sin(t), z), (1, 1, 0.6))
            for t, z in ((0, 0.7), (1.3, 0.85), (2.6, 0.75), (3.9, 0.95), (5.2, 0.8), (0.6, 1.1), (3.2, 1.2))
        ]
        leaves.append(rod((0, 0, 0.3), (0, 0, 1.1), 0.03))
    return [
        part("paint", lathe(((0.17, 0), (0.26, 0.42), (0.28, 0.44), (0.2, 0.42))), tint=s.tint),
        part("soil", cylinder(0.23, 0.01, (0, 0, 0.41))),
        part("foliage", *leaves),
    ]


def hay_bale(s: Style) -> Parts:
    if s.shape == 1:  # a stack of oblong bales
        bales = [box(0.6, 1.1, 0.45, at) for at in ((0, -0.58, 0), (0, 0.58, 0), (0, 0, 0.46))]
        return [part("straw", *bales)]
    return [part("straw", cylinder(0.75, 1.3, (0, 0, -0.65), sides=20).turned(90, "x").moved(0, 0, 0.75))]


def maize_plant(s: Style) -> Parts:
    stems = []
    for i in range(4):
        for j in range(7):
            x, y = (i - 1.5) * 0.7 + s.rng.uniform(-0.1, 0.1), (j - 3) * 0.45
            stems += [
                cylinder(0.2, 1.2, (x, y, 0.5), top=0.03, sides=6),
                cylinder(0.03, 1.9, (x, y, 0), sides=5),
                cylinder(0.26, 0.9, (x, y, 0.1), top=0.05, sides=6),
            ]
    return [part("maize", *stems)]


def pumpkin(s: Style) -> Parts:
    balls = [sphere(0.3, (x, y, 0.22), (1, 1, 0.78)) for x, y in ((0, 0), (0.6, 0.3), (-0.1, 0.7), (0.5, -0.4))]
    return [
        part("pumpkin", *balls),
        part(
            "foliage",
            *(
                rod((x, y, 0.42), (x + 0.04, y, 0.56), 0.035, 5)
                for x, y in ((0, 0), (0.6, 0.3), (-0.1, 0.7), (0.5, -0.4))
            ),
            *(sphere(0.16, (x, y, 0.08), (1, 1, 0.3)) for x, y in ((0.3, 0.1), (0.2, 0.5), (0.3, -0.3))),
        ),
    ]


def log_pile(s: Style) -> Parts:
    logs = []
    for row, count in enumerate((5, 4, 3)):
        logs += [
            cylinder(0.19, 2.2, (0, 0, -1.1), sides=10)
            .turned(90, "y")
            .moved(0, (i - (count - 1) / 2) * 0.39, 0.19 + row * 0.34)
            for i in range(count)
        ]
    ends = [
        cylinder(0.15, 0.02, (0, 0, 0), sides=10).turned(90, "y").moved(1.1, (i - (c - 1) / 2) * 0.39, 0.19 + r * 0.34)
        for r, c in enumerate((5, 4, 3))
        for i in range(c)
    ]
    return [part("bark", *logs), part("pale wood", *ends)]


BUILDERS = (tree, conifer, hedge, shrub, flower_bed, potted_plant, hay_bale, maize_plant, pumpkin, log_pile)
