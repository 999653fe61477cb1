"""What drives, or is pushed."""

from __future__ import annotations

from erag.sim.mesh import Mesh, bars, box, cylinder, panel, prism, ring, rod, sphere, wheel
from erag.sim.model import PALETTE, Parts, Picture, Style, part

DARK = (0.2, 0.2, 0.22)


def _wheels(front: float, rear: float, track: float, radius: float, width: float = 0.2) -> Parts:
    at = [(x, y, radius) for x in (front, rear) for y in (-track, track)]
    hubs = [wheel(radius * 0.55, width + 0.02, p) for p in at]
    return [part("rubber", *(wheel(radius, width, p) for p in at)), part("steel", *hubs)]


def _lights(x_front: float, x_rear: float, y: float, z: float) -> Parts:
    front = [box(0.06, 0.28, 0.14, (x_front, side * y, z)) for side in (-1, 1)]
    rear = [box(0.06, 0.28, 0.14, (x_rear, side * y, z)) for side in (-1, 1)]
    return [part("lamp", *front), part("paint", *rear, tint=(0.85, 0.06, 0.06))]


def car(s: Style) -> Parts:
    body: tuple[tuple[float, float], ...]
    if s.shape == 1:  # hatchback
        body = ((-1.85, 0.3), (1.9, 0.3), (1.95, 0.72), (1.15, 0.9), (-1.85, 0.95))
        cabin = ((-1.8, 0.93), (1.05, 0.9), (0.35, 1.48), (-1.35, 1.5))
    elif s.shape == 2:  # estate, angular
        body = ((-2.3, 0.35), (2.2, 0.35), (2.25, 1.0), (0.9, 1.08), (-2.3, 1.08))
        cabin = ((-2.25, 1.06), (0.95, 1.06), (0.6, 1.75), (-2.2, 1.75))
    else:  # saloon
        body = ((-2.15, 0.3), (2.15, 0.3), (2.2, 0.7), (1.1, 0.88), (-1.6, 0.92), (-2.2, 0.86))
        cabin = ((-1.55, 0.9), (1.05, 0.87), (0.3, 1.42), (-1.0, 1.42))
    top = max(z for _, z in cabin)
    roof = box(1.2 if s.shape == 0 else 1.8, 1.3, 0.05, (-0.4 if s.shape == 0 else -0.75, 0, top - 0.01))
    pillars = [box(0.09, 1.6, 0.5, (-0.35, 0, top - 0.52))]
    plate = Picture("text", "ER 42", (0.1, 0.1, 0.1), (0.95, 0.95, 0.9), 4)
    ends = (body[2][0], body[0][0])
    return [
        part("paint", prism(body, 1.75), roof, *pillars, tint=s.tint),
        part("dark glass", prism(cabin, 1.52)),
        part("rubber", box(0.12, 1.76, 0.16, (ends[0], 0, 0.34)), box(0.12, 1.76, 0.16, (ends[1], 0, 0.34))),
        part(
            "picture",
            panel(0.5, 0.12, (ends[0] + 0.07, 0, 0.4)),
            panel(0.5, 0.12, (ends[1] - 0.07, 0, 0.4), 180),
            picture=plate,
        ),
        *_wheels(1.3, -1.3, 0.8, 0.33),
        *_lights(ends[0] - 0.02, ends[1] + 0.01, 0.64, 0.58),
    ]


def van(s: Style) -> Parts:
    shape = ((-2.6, 0.4), (2.5, 0.4), (2.55, 1.1), (1.75, 1.35), (1.2, 2.25), (-2.6, 2.3))
    sign = Picture("bare", s.text or "PARCELS", (0.1, 0.2, 0.5), s.tint, 3.6)
    return [
        part("paint", prism(shape, 1.95), tint=s.tint),
        part(
            "dark glass",
            prism(((1.3, 1.42), (1.8, 1.36), (1.27, 2.1), (1.1, 2.1)), 1.97),
            box(0.8, 1.98, 0.6, (0.8, 0, 1.4)),
        ),
        part("picture", panel(2.6, 0.7, (-1.1, 1.0, 1.2), 90), panel(2.6, 0.7, (-1.1, -1.0, 1.2), -90), picture=sign),
        part("rubber", box(0.12, 1.9, 0.25, (2.53, 0, 0.4))),
        *_wheels(1.7, -1.6, 0.9, 0.37),
        *_lights(2.55, -2.6, 0.75, 0.85),
    ]


def ambulance(s: Style) -> Parts:
    shape = ((-2.7, 0.4), (2.5, 0.4), (2.55, 1.15), (1.85, 1.4), (1.4, 2.2), (1.2, 2.55), (-2.7, 2.55))
    band = [box(4.6, 2.02, 0.3, (-0.4, 0, 1.0))]
    sign = Picture("bare", "AMBULANCE", (0.8, 0.05, 0.05), (0.97, 0.97, 0.95), 4.4)
    cross = Picture("cross", ink=(0.85, 0.05, 0.05))
    return [
        part("paint", prism(shape, 2.0), tint=(0.97, 0.97, 0.95)),
        part("paint", *band, tint=s.tint),
        part(
            "dark glass",
            prism(((1.45, 1.5), (1.9, 1.42), (1.4, 2.15), (1.2, 2.15)), 2.02),
            box(0.7, 2.03, 0.55, (0.95, 0, 1.5)),
        ),
        part(
            "picture",
            panel(2.2, 0.5, (-0.6, 1.02, 1.75), 90),
            panel(2.2, 0.5, (-0.6, -1.02, 1.75), -90),
            panel(1.6, 0.4, (-2.72, 0, 2.0), 180),
            picture=sign,
        ),
        part(
            "picture",
            panel(0.6, 0.6, (-2.1, 1.02, 1.7), 90),
            panel(0.6, 0.6, (-2.1, -1.02, 1.7), -90),
            panel(0.6, 0.6, (-2.72, 0, 1.3), 180),
            picture=cross,
        ),
        part("lamp", box(0.3, 1.5, 0.16, (1.0, 0, 2.55)), tint=(0.15, 0.35, 1.0)),
        *_wheels(1.7, -1.6, 0.92, 0.38),
        *_lights(2.55, -2.7, 0.75, 0.85),
    ]


def bus(s: Style) -> Parts:
    sides = [box(7.4, 2.54, 0.85, (-0.3, 0, 1.5)), box(0.1, 2.1, 1.2, (4.5, 0, 1.3))]
    pillars = [box(0.12, 2.56, 0.86, (x, 0, 1.5)) for x in (-3.3, -1.8, -0.3, 1.2, 2.7)]
    sign = Picture("bare", s.text or "42 CENTRE", (1.0, 0.75, 0.1), (0.08, 0.08, 0.08), 6)
    return [
        part("paint", box(9.0, 2.5, 2.6, (0, 0, 0.45)), *pillars, tint=s.tint),
        part("dark glass", *sides),
        part("lit picture", panel(1.8, 0.34, (4.57, 0, 2.6)), picture=sign),
        part("rubber", box(0.7, 2.54, 1.9, (3.6, 0, 0.55))),
        *_wheels(2.9, -2.8, 1.15, 0.48, 0.28),
        *_lights(4.5, -4.5, 0.95, 0.75),
    ]


def lorry(s: Style) -> Parts:
    cab = prism(((2.2, 0.6), (4.0, 0.6), (4.0, 1.7), (3.8, 2.6), (2.2, 2.7)), 2.2)
    cargo = Picture("bare", s.text or "FREIGHT", s.tint, (0.93, 0.93, 0.9), 3.6)
    return [
        part("paint", cab, tint=s.tint),
        part("dark glass", box(0.2, 1.9, 0.7, (3.86, 0, 1.75)), box(0.8, 2.24, 0.6, (3.2, 0, 1.75))),
        part("corrugated", box(5.8, 2.4, 2.4, (-0.9, 0, 0.95)), tint=(0.95, 0.95, 0.93)),
        part("iron", box(7.6, 1.0, 0.3, (0, 0, 0.65)), box(0.15, 2.2, 0.3, (4.0, 0, 0.5))),
        part(
            "picture", panel(3.6, 1.0, (-0.9, 1.22, 1.6), 90), panel(3.6, 1.0, (-0.9, -1.22, 1.6), -90), picture=cargo
        ),
        *_wheels(3.1, -2.6, 1.0, 0.5, 0.3),
        part("rubber", wheel(0.5, 0.3, (-1.4, 1, 0.5)), wheel(0.5, 0.3, (-1.4, -1, 0.5))),
        *_lights(4.05, -3.8, 0.9, 0.75),
    ]


def tractor(s: Style) -> Parts:
    big = [wheel(0.85, 0.45, (-0.8, y, 0.85)) for y in (-0.85, 0.85)]
    small = [wheel(0.45, 0.3, (1.2, y, 0.45)) for y in (-0.7, 0.7)]
    cab = [box(0.07, 0.07, 1.2, (x, y, 1.4)) for x in (-1.2, -0.1) for y in (-0.55, 0.55)]
    return [
        part("rubber", *big, *small),
        part(
            "paint",
            *(wheel(0.42, 0.48, (-0.8, y, 0.85)) for y in (-0.85, 0.85)),
            *(wheel(0.22, 0.32, (1.2, y, 0.45)) for y in (-0.7, 0.7)),
            tint=PALETTE["yellow"] if s.colour != "yellow" else PALETTE["grey"],
        ),
        part(
            "paint",
            prism(((-0.2, 0.7), (1.7, 0.7), (1.75, 1.3), (-0.2, 1.5)), 0.8),
            box(1.3, 1.3, 0.1, (-0.65, 0, 2.6)),
            box(1.1, 1.2, 0.5, (-0.7, 0, 0.9)),
            *cab,
            tint=s.tint,
        ),
        part("glass", box(1.04, 1.04, 1.1, (-0.65, 0, 1.45))),
        part("iron", cylinder(0.05, 1.1, (0.9, 0.25, 1.35)), box(2.6, 0.4, 0.3, (0.3, 0, 0.5))),
        part("lamp", *(box(0.04, 0.2, 0.14, (1.75, y, 1.05)) for y in (-0.25, 0.25))),
    ]


def bicycle(s: Style) -> Parts:
    frame = [
        bars(((-0.5, 0, 0.34), (-0.08, 0, 0.3), (0.38, 0, 0.78), (-0.18, 0, 0.74), (-0.5, 0, 0.34)), 0.025),
        rod((-0.08, 0, 0.3), (-0.22, 0, 0.88), 0.025),
        rod((0.55, 0, 0.34), (0.36, 0, 0.95), 0.025),
    ]
    tyres = [ring(0.33, 0.03, (x, 0, 0.34)) for x in (-0.5, 0.55)]
    spokes = [rod((x - 0.3, 0, 0.34), (x + 0.3, 0, 0.34), 0.008, 4) for x in (-0.5, 0.55)] + [
        rod((x, 0, 0.04), (x, 0, 0.64), 0.008, 4) for x in (-0.5, 0.55)
    ]
    extras: list[Mesh] = [
        rod((0.34, -0.26, 0.97), (0.34, 0.26, 0.97), 0.025),
        box(0.28, 0.15, 0.06, (-0.24, 0, 0.88)),
        cylinder(0.09, 0.03, (0, 0, 0)).turned(90, "x").moved(-0.08, 0.03, 0.3),
    ]
    basket = [part("straw", box(0.28, 0.34, 0.24, (0.58, 0, 0.74)))] if s.shape == 1 else []
    return [part("paint", *frame, tint=s.tint), part("rubber", *tyres, *extras), part("chrome", *spokes), *basket]


def motor_scooter(s: Style) -> Parts:
    return [
        part(
            "rubber",
            *(wheel(0.26, 0.14, (x, 0, 0.26)) for x in (-0.6, 0.65)),
            prism(((-0.75, 0.8), (0.05, 0.78), (0.02, 0.9), (-0.75, 0.92)), 0.32),
        ),
        part(
            "paint",
            prism(((-0.85, 0.35), (-0.1, 0.3), (0.0, 0.78), (-0.8, 0.8)), 0.4),
            box(0.55, 0.34, 0.08, (0.18, 0, 0.26)),
            prism(((0.4, 0.3), (0.55, 0.3), (0.5, 1.0), (0.35, 0.95)), 0.44),
            box(0.3, 0.2, 0.08, (0.68, 0, 0.5)),
            tint=s.tint,
        ),
        part("iron", rod((0.62, 0, 0.3), (0.42, 0, 1.1), 0.04), rod((0.42, -0.34, 1.1), (0.42, 0.34, 1.1), 0.03)),
        part("lamp", sphere(0.1, (0.56, 0, 0.9))),
        part("chrome", *(sphere(0.07, (0.42, y, 1.28), (0.3, 1, 1)) for y in (-0.3, 0.3))),
    ]


def forklift(s: Style) -> Parts:
    mast = [box(0.1, 0.1, 2.4, (0.95, y, 0.1)) for y in (-0.32, 0.32)] + [
        box(0.08, 0.7, 0.08, (0.95, 0, z)) for z in (0.9, 2.3)
    ]
    forks = [box(1.1, 0.12, 0.06, (1.55, y, 0.12)) for y in (-0.28, 0.28)] + [box(0.06, 0.8, 0.5, (1.02, 0, 0.12))]
    guard = [box(0.07, 0.07, 1.3, (x, y, 0.95)) for x in (-0.7, 0.6) for y in (-0.45, 0.45)]
    return [
        part(
            "paint",
            prism(((-1.05, 0.25), (0.85, 0.25), (0.85, 0.75), (0.2, 0.8), (-0.4, 1.05), (-1.05, 1.0)), 1.05),
            tint=s.tint,
        ),
        part("iron", *mast, *forks, *guard, box(1.45, 1.0, 0.06, (-0.05, 0, 2.2))),
        part("rubber", box(0.45, 0.5, 0.15, (-0.15, 0, 1.0)), box(0.12, 0.5, 0.5, (-0.4, 0, 1.05))),
        part("hazard", box(0.05, 1.0, 0.25, (-1.06, 0, 0.4))),
        *_wheels(0.6, -0.7, 0.5, 0.28),
    ]


def shopping_trolley(s: Style) -> Parts:
    basket = prism(((-0.4, 0.42), (0.4, 0.52), (0.46, 0.95), (-0.46, 0.95)), 0.52)
    frame = [bars(((-0.45, y, 0.95), (-0.4, y, 0.2), (0.4, y, 0.14)), 0.02) for y in (-0.24, 0.24)]
    return [
        part("cage", basket),
        part("chrome", *frame),
        part("plastic", rod((-0.5, -0.28, 1.0), (-0.5, 0.28, 1.0), 0.035), tint=s.tint),
        part("rubber", *(wheel(0.07, 0.05, (x, y, 0.07)) for x in (-0.4, 0.4) for y in (-0.24, 0.24))),
    ]


def wheelchair(s: Style) -> Parts:
    big = [ring(0.3, 0.025, (-0.1, y, 0.31)) for y in (-0.32, 0.32)]
    small = [wheel(0.09, 0.05, (0.38, y, 0.09)) for y in (-0.25, 0.25)]
    frame = [
        bars(((-0.3, y, 0.98), (-0.26, y, 0.5), (0.26, y, 0.5), (0.45, y, 0.14)), 0.022) for y in (-0.26, 0.26)
    ] + [rod((-0.42, y, 0.96), (-0.28, y, 0.96), 0.03) for y in (-0.26, 0.26)]
    hubs = [rod((-0.4, y, 0.31), (0.2, y, 0.31), 0.01, 4) for y in (-0.32, 0.32)] + [
        rod((-0.1, y, 0.01), (-0.1, y, 0.61), 0.01, 4) for y in (-0.32, 0.32)
    ]
    return [
        part("rubber", *big, *small),
        part("chrome", *frame, *hubs),
        part("leather", box(0.46, 0.48, 0.07, (0, 0, 0.48)), box(0.05, 0.48, 0.42, (-0.27, 0, 0.55)), tint=s.tint),
        part(
            "iron",
            *(box(0.3, 0.06, 0.04, (0, y, 0.7)) for y in (-0.28, 0.28)),
            *(box(0.16, 0.16, 0.02, (0.5, y, 0.12)) for y in (-0.14, 0.14)),
        ),
    ]


BUILDERS = (
    car,
    van,
    ambulance,
    bus,
    lorry,
    tractor,
    bicycle,
    motor_scooter,
    forklift,
    shopping_trolley,
    wheelchair,
)
