"""What stands in streets."""

from __future__ import annotations

import math

from erag.sim.mesh import Mesh, bars, box, cylinder, lathe, panel, prism, rod, sphere
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def bench(s: Style) -> Parts:
    if s.shape == 2:  # a block of stone with a wooden seat, no back
        return [
            part("stone", box(0.5, 0.3, 0.4, (0, -0.6, 0)), box(0.5, 0.3, 0.4, (0, 0.6, 0))),
            part("planks", box(0.55, 1.8, 0.08, (0, 0, 0.4)), tint=s.tint),
        ]
    seat = [box(0.11, 1.7, 0.05, (x, 0, 0.43)) for x in (-0.2, -0.06, 0.08, 0.22)]
    back = [box(0.05, 1.7, 0.12, (-0.29 - 0.03 * i, 0, 0.55 + 0.16 * i)) for i in range(3)]
    legs: list[Mesh] = []
    for y in (-0.7, 0.7):
        legs += [
            box(0.07, 0.07, 0.43, (0.22, y, 0)),
            box(0.07, 0.07, 0.9, (-0.26, y, 0)),
            box(0.55, 0.06, 0.05, (0, y, 0.38)),
            box(0.5, 0.06, 0.05, (0, y, 0.66)),
        ]
    return [part("wood" if s.shape == 0 else "paint", *seat, *back, tint=s.tint), part("iron", *legs)]


def street_lamp(s: Style) -> Parts:
    if s.shape == 1:  # a tall mast with an arm
        return [
            part("steel", cylinder(0.1, 6.5, top=0.06), rod((0, 0, 6.4), (1.5, 0, 6.7), 0.05)),
            part("iron", box(0.8, 0.3, 0.12, (1.5, 0, 6.66))),
            part("lamp", box(0.7, 0.24, 0.05, (1.5, 0, 6.61))),
        ]
    if s.shape == 2:  # three globes
        globes = [sphere(0.2, (0.45 * math.cos(t), 0.45 * math.sin(t), 3.3)) for t in (0.0, 2.1, 4.2)]
        arms = [rod((0, 0, 2.9), (0.45 * math.cos(t), 0.45 * math.sin(t), 3.12), 0.03) for t in (0.0, 2.1, 4.2)]
        return [
            part("iron", cylinder(0.14, 0.5, top=0.08), cylinder(0.06, 3.0), *arms, tint=s.tint),
            part("lamp", *globes),
        ]
    lantern = [cylinder(0.13, 0.42, (0, 0, 3.3), top=0.24, sides=6)]
    caps = [cylinder(0.28, 0.22, (0, 0, 3.72), top=0.03, sides=6), cylinder(0.16, 0.06, (0, 0, 3.25))]
    post = [
        cylinder(0.16, 0.5, top=0.1),
        cylinder(0.06, 3.3),
        sphere(0.11, (0, 0, 2.7)),
        rod((0, -0.4, 2.9), (0, 0.4, 2.9), 0.03),
    ]
    return [part("iron", *post, *caps), part("lamp", *lantern)]


def traffic_light(s: Style) -> Parts:
    pole = [cylinder(0.08, 3.4)]
    head = [box(0.26, 0.4, 1.05, (0.12, 0, 2.4)), box(0.04, 0.56, 1.2, (0, 0, 2.33))]
    lights = [
        part(m, sphere(0.13, (0.26, 0, z), (0.4, 1, 1)), tint=c)
        for z, c, m in (
            (3.23, (1.0, 0.1, 0.08), "lamp"),
            (2.92, (0.95, 0.7, 0.1), "paint"),
            (2.6, (0.1, 0.85, 0.3), "paint"),
        )
    ]
    return [part("steel", *pole), part("iron", *head), *lights]


def litter_bin(s: Style) -> Parts:
    if s.shape == 2:  # a wire basket on a post
        return [
            part("cage", cylinder(0.28, 0.6, (0.2, 0, 0.35), top=0.34)),
            part("iron", cylinder(0.05, 1.2)),
            part("paint", box(0.02, 0.3, 0.2, (0, 0, 1.15)), tint=s.tint),
        ]
    if s.shape == 1:  # a square bin with a roof
        return [
            part("paint", box(0.5, 0.5, 0.85), tint=s.tint),
            part("dark glass", box(0.52, 0.38, 0.2, (0, 0, 0.88))),
            part(
                "paint",
                box(0.5, 0.06, 0.28, (0, 0.22, 0.85)),
                box(0.5, 0.06, 0.28, (0, -0.22, 0.85)),
                prism(((-0.3, 1.1), (0.3, 1.1), (0, 1.28)), 0.56),
                tint=s.tint,
            ),
        ]
    return [
        part("paint", cylinder(0.28, 0.9, top=0.31), tint=s.tint),
        part("iron", cylinder(0.33, 0.06, (0, 0, 0.9))),
        part("rubber", cylinder(0.24, 0.02, (0, 0, 0.95))),
        part("picture", panel(0.3, 0.2, (0.325, 0, 0.55)), picture=Picture("bare", "LITTER", (1, 1, 1), s.tint, 1.5)),
    ]


def fire_hydrant(s: Style) -> Parts:
    body = lathe(
        ((0.2, 0), (0.2, 0.06), (0.13, 0.08), (0.13, 0.55), (0.17, 0.57), (0.17, 0.61), (0.14, 0.66), (0.0, 0.8))
    )
    caps = [rod((0, -0.24, 0.42), (0, 0.24, 0.42), 0.075), rod((0, 0, 0.4), (0.24, 0, 0.4), 0.09)]
    tops = [
        cylinder(0.04, 0.08, (0, 0, 0.78), sides=5),
        *(sphere(0.085, (0, y, 0.42), (1, 0.4, 1)) for y in (-0.24, 0.24)),
    ]
    return [part("paint", body, *caps, tint=s.tint), part("steel", *tops)]


def post_box(s: Style) -> Parts:
    if s.shape == 1:  # a box on a leg
        return [
            part("iron", box(0.12, 0.12, 0.9)),
            part("paint", box(0.4, 0.5, 0.65, (0, 0, 0.8)), box(0.46, 0.56, 0.08, (0, 0, 1.42)), tint=s.tint),
            part(
                "picture",
                panel(0.42, 0.16, (0.21, 0, 1.0)),
                picture=Picture("bare", "POST", (0.1, 0.1, 0.1), (1, 0.95, 0.7), 2.4),
            ),
            part("rubber", box(0.02, 0.3, 0.05, (0.21, 0, 1.28))),
        ]
    drum = [cylinder(0.36, 0.16), cylinder(0.31, 1.3), lathe(((0.36, 1.3), (0.38, 1.38), (0.3, 1.5), (0, 1.58)))]
    return [
        part("paint", *drum, tint=s.tint),
        part("rubber", box(0.04, 0.34, 0.06, (0.3, 0, 1.12))),
        part("picture", panel(0.26, 0.24, (0.32, 0, 0.7)), picture=Picture("lines", "POST", aspect=1.0)),
    ]


def bus_shelter(s: Style) -> Parts:
    posts = [box(0.08, 0.08, 2.4, (x, y, 0)) for x in (-0.7, 0.7) for y in (-1.7, 1.7)]
    glass = [box(0.03, 3.3, 1.9, (-0.7, 0, 0.3)), box(1.3, 0.03, 1.9, (0, 1.7, 0.3))]
    return [
        part("iron", *posts),
        part("glass", *glass),
        part("paint", box(1.7, 3.8, 0.12, (0, 0, 2.4)), tint=s.tint),
        part("wood", box(0.4, 2.4, 0.06, (-0.4, -0.2, 0.45))),
        part("iron", *(box(0.06, 0.06, 0.45, (-0.4, y, 0)) for y in (-1.2, 0.8))),
        part("paint", cylinder(0.04, 2.9, (0.9, -2.2, 0)), tint=PALETTE["grey"]),
        part(
            "picture",
            panel(0.7, 0.7, (0.95, -2.2, 2.3)),
            picture=Picture("text", "BUS\nSTOP", (1, 1, 1), (0.1, 0.3, 0.7)),
        ),
        part(
            "picture",
            panel(1.8, 0.3, (0.86, 0, 2.38)),
            picture=Picture("bare", s.text or "BUS 42", (1, 1, 0.9), s.tint, 6),
        ),
    ]


def bicycle_rack(s: Style) -> Parts:
    hoops = []
    for x in (-1.2, -0.4, 0.4, 1.2):
        hoops.append(
            bars(
                ((x, -0.35, 0), (x, -0.35, 0.65), (x, -0.2, 0.82), (x, 0.2, 0.82), (x, 0.35, 0.65), (x, 0.35, 0)), 0.035
            )
        )
    return [
        part("chrome" if not s.colour else "paint", *hoops, tint=s.tint),
        part("iron", box(2.8, 0.06, 0.04, (0, -0.35, 0)), box(2.8, 0.06, 0.04, (0, 0.35, 0))),
    ]


def parking_meter(s: Style) -> Parts:
    return [
        part("steel", cylinder(0.05, 1.15)),
        part("paint", box(0.26, 0.34, 0.5, (0, 0, 1.1)), lathe(((0.2, 1.58), (0.13, 1.7), (0, 1.74))), tint=s.tint),
        part("screen", box(0.02, 0.2, 0.14, (0.13, 0, 1.4)), tint=(0.6, 0.75, 0.6)),
        part("rubber", box(0.02, 0.12, 0.03, (0.13, 0, 1.25))),
        part("picture", panel(0.26, 0.26, (0.14, 0, 1.52)), picture=Picture("bare", "P", (1, 1, 1), (0.1, 0.3, 0.75))),
    ]


def bollard(s: Style) -> Parts:
    return [
        part("paint", cylinder(0.11, 0.85), sphere(0.11, (0, 0, 0.85)), tint=s.tint),
        part("paint", cylinder(0.115, 0.1, (0, 0, 0.66)), tint=PALETTE["white"]),
    ]


def traffic_cone(s: Style) -> Parts:
    return [
        part(
            "plastic",
            box(0.5, 0.5, 0.05),
            cylinder(0.2, 0.26, (0, 0, 0.05), top=0.14),
            cylinder(0.09, 0.22, (0, 0, 0.5), top=0.04),
            tint=s.tint,
        ),
        part("paint", cylinder(0.14, 0.2, (0, 0, 0.31), top=0.09), tint=PALETTE["white"]),
    ]


def telephone_box(s: Style) -> Parts:
    frame = [box(0.1, 0.1, 2.4, (x, y, 0)) for x in (-0.45, 0.45) for y in (-0.45, 0.45)]
    rails = [box(0.92, 0.04, 0.05, (0, y, z)) for y in (-0.46, 0.46) for z in (0.5, 0.9, 1.3, 1.7)]
    rails += [box(0.04, 0.92, 0.05, (x, 0, z)) for x in (-0.46, 0.46) for z in (0.5, 0.9, 1.3, 1.7)]
    return [
        part(
            "paint",
            *frame,
            *rails,
            box(1, 1, 0.3),
            box(1.0, 1.0, 0.35, (0, 0, 2.05)),
            lathe(((0.66, 2.4), (0.5, 2.55), (0, 2.66)), sides=4).turned(45),
            tint=s.tint,
        ),
        part("glass", box(0.86, 0.86, 1.75, (0, 0, 0.3)), tint=(0.85, 1, 1)),
        part(
            "picture",
            panel(0.8, 0.2, (0.51, 0, 2.12)),
            picture=Picture("bare", "TELEPHONE", (0.1, 0.1, 0.1), (1, 1, 0.95), 4),
        ),
    ]


def charging_station(s: Style) -> Parts:
    cable = bars(((0.15, 0.2, 1.0), (0.35, 0.3, 0.5), (0.4, 0.1, 0.2), (0.35, -0.15, 0.5), (0.18, -0.2, 0.95)), 0.03)
    return [
        part("concrete", box(0.6, 0.7, 0.12)),
        part("paint", box(0.3, 0.5, 1.5, (0, 0, 0.12)), tint=PALETTE["white"]),
        part("paint", box(0.32, 0.52, 0.3, (0, 0, 1.5)), tint=s.tint),
        part("screen", box(0.02, 0.3, 0.22, (0.15, 0, 1.2)), tint=(0.2, 0.5, 0.9)),
        part("rubber", cable),
        part("picture", panel(0.44, 0.26, (0.165, 0, 1.52)), picture=Picture("bare", "EV", (1, 1, 1), s.tint, 1.6)),
    ]


def flagpole(s: Style) -> Parts:
    return [
        part("paint", cylinder(0.08, 7.0, top=0.04), sphere(0.1, (0, 0, 7.05)), tint=PALETTE["white"]),
        part("stone", cylinder(0.4, 0.3)),
        part("cloth", box(0.02, 1.6, 0.36, (0, 0.85, 6.3)), tint=s.tint),
        part("cloth", box(0.02, 1.6, 0.36, (0, 0.85, 5.94)), tint=PALETTE["white"]),
        part("cloth", box(0.02, 1.6, 0.36, (0, 0.85, 5.58)), tint=s.tint),
    ]


def recycling_container(s: Style) -> Parts:
    bins: Parts = []
    for i, colour in enumerate(("green", "blue", "yellow")):
        y = (i - 1) * 1.25
        label = ("GLASS", "PAPER", "PLASTIC")[i]
        bins += [
            part(
                "plastic",
                prism(((-0.5, 0), (0.5, 0), (0.55, 1.1), (0.35, 1.4), (-0.35, 1.4), (-0.55, 1.1)), 1.15, (0, y, 0)),
                tint=PALETTE[colour],
            ),
            part("rubber", sphere(0.14, (0.47, y, 1.2), (0.5, 1, 1))),
            part(
                "picture",
                panel(0.8, 0.3, (0.56, y, 0.6)),
                picture=Picture("bare", label, (1, 1, 1), PALETTE[colour], 2.7),
            ),
        ]
    return bins


def fence(s: Style) -> Parts:
    long = s.extent or 3.0
    posts = [box(0.1, 0.1, 1.15, (0, -long / 2 + i * long / 3, 0)) for i in range(4)]
    rails = [box(0.05, long, 0.1, (0, 0, z)) for z in (0.35, 0.8)]
    if s.shape == 1:  # pickets
        n = int(long / 0.22)
        return [
            part(
                "paint",
                *rails,
                *(box(0.03, 0.1, 1.0, (0.04, -long / 2 + (i + 0.5) * long / n, 0.05)) for i in range(n)),
                tint=s.tint,
            )
        ]
    if s.shape == 2:  # wire mesh
        return [part("net", box(0.03, long, 1.3, (0, 0, 0.1))), part("steel", *posts)]
    return [part("rough wood", *posts, *rails, box(0.05, long, 0.1, (0, 0, 1.0)))]


BUILDERS = (
    bench,
    street_lamp,
    traffic_light,
    litter_bin,
    fire_hydrant,
    post_box,
    bus_shelter,
    bicycle_rack,
    parking_meter,
    bollard,
    traffic_cone,
    telephone_box,
    charging_station,
    flagpole,
    recycling_container,
    fence,
)
