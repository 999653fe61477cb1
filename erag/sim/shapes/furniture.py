"""Furniture."""

from __future__ import annotations

import math

from erag.sim.mesh import Mesh, box, cylinder, lathe, panel, prism, rod, sphere
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def _legs(dx: float, dy: float, high: float, thick: float = 0.06) -> list[Mesh]:
    return [box(thick, thick, high, (x, y, 0)) for x in (-dx / 2, dx / 2) for y in (-dy / 2, dy / 2)]


def chair(s: Style) -> Parts:
    if s.shape == 1:  # a plastic shell on a tube frame
        return [
            part("plastic", box(0.42, 0.44, 0.04, (0, 0, 0.45)), box(0.04, 0.42, 0.4, (-0.21, 0, 0.5)), tint=s.tint),
            part(
                "chrome", *(rod((x, y, 0), (x * 0.8, y * 0.8, 0.46), 0.015) for x in (-0.22, 0.22) for y in (-0.2, 0.2))
            ),
        ]
    if s.shape == 2:  # spindles
        return [
            part(
                "paint",
                cylinder(0.23, 0.05, (0, 0, 0.44)),
                *(rod((-0.2, y * 0.8, 0.48), (-0.26, y, 0.92), 0.012) for y in (-0.18, -0.09, 0, 0.09, 0.18)),
                box(0.04, 0.46, 0.06, (-0.26, 0, 0.9)),
                *(rod((x * 1.2, y * 1.2, 0), (x, y, 0.45), 0.018) for x in (-0.16, 0.16) for y in (-0.16, 0.16)),
                tint=s.tint,
            )
        ]
    return [
        part(
            "wood",
            box(0.44, 0.44, 0.05, (0, 0, 0.43)),
            *_legs(0.38, 0.38, 0.43, 0.045),
            *(box(0.04, 0.04, 0.5, (-0.2, y, 0.46)) for y in (-0.19, 0.19)),
            *(box(0.03, 0.4, 0.08, (-0.2, 0, z)) for z in (0.6, 0.74, 0.88)),
            tint=s.tint,
        )
    ]


def armchair(s: Style) -> Parts:
    if s.shape == 1:  # a wing chair
        wings = [prism(((-0.4, 0.5), (-0.05, 0.6), (-0.2, 1.15), (-0.4, 1.2)), 0.1, (0, y, 0)) for y in (-0.38, 0.38)]
        return [
            part(
                "cloth",
                box(0.72, 0.62, 0.28, (0.04, 0, 0.18)),
                box(0.18, 0.74, 0.95, (-0.36, 0, 0.3)),
                *wings,
                *(box(0.6, 0.13, 0.3, (0.02, y, 0.4)) for y in (-0.37, 0.37)),
                tint=s.tint,
            ),
            part("dark wood", *_legs(0.6, 0.56, 0.2)),
        ]
    return [
        part(
            "cloth",
            box(0.8, 0.62, 0.32, (0.04, 0, 0.1)),
            box(0.22, 0.9, 0.8, (-0.36, 0, 0.1)),
            *(box(0.85, 0.2, 0.55, (0, y, 0.1)) for y in (-0.4, 0.4)),
            tint=s.tint,
        ),
        part("cloth", box(0.62, 0.56, 0.14, (0.08, 0, 0.42)), tint=lighter(s)),
        part("dark wood", *_legs(0.7, 0.7, 0.1)),
    ]


def lighter(s: Style) -> tuple[float, float, float]:
    """The style's colour, lighter: cushions."""
    r, g, b = s.tint
    return (0.7 * r + 0.3, 0.7 * g + 0.3, 0.7 * b + 0.3)


def sofa(s: Style) -> Parts:
    material = "leather" if s.shape == 1 else "cloth"
    cushions = [box(0.62, 0.86, 0.16, (0.08, y, 0.4)) for y in (-0.45, 0.45)] + [
        box(0.18, 0.84, 0.4, (-0.24, y, 0.5)) for y in (-0.45, 0.45)
    ]
    return [
        part(
            material,
            box(0.9, 2.1, 0.32, (0, 0, 0.1)),
            box(0.22, 2.1, 0.82, (-0.4, 0, 0.1)),
            *(box(0.9, 0.2, 0.58, (0, y, 0.1)) for y in (-1.05, 1.05)),
            tint=s.tint,
        ),
        part(material, *cushions, tint=lighter(s)),
        part("dark wood", *_legs(0.8, 1.9, 0.1)),
    ]


def table(s: Style) -> Parts:
    if s.shape == 1:  # round, on one foot
        return [
            part("pale wood", cylinder(0.65, 0.05, (0, 0, 0.71), sides=20), tint=s.tint),
            part("iron", cylinder(0.05, 0.7), cylinder(0.34, 0.04)),
        ]
    if s.shape == 2:  # trestles
        return [
            part("planks", box(0.9, 1.8, 0.05, (0, 0, 0.72)), tint=s.tint),
            part(
                "paint",
                *(rod((sx * 0.36, y, 0), (0, y, 0.72), 0.03) for sx in (-1, 1) for y in (-0.65, 0.65)),
                tint=PALETTE["white"],
            ),
        ]
    return [
        part(
            "wood",
            box(0.9, 1.7, 0.05, (0, 0, 0.7)),
            box(0.8, 1.6, 0.1, (0, 0, 0.6)),
            *_legs(0.8, 1.6, 0.7, 0.08),
            tint=s.tint,
        )
    ]


def coffee_table(s: Style) -> Parts:
    if s.shape == 1:
        return [
            part("glass", cylinder(0.5, 0.03, (0, 0, 0.4), sides=20)),
            part(
                "chrome",
                *(
                    rod(
                        (0.4 * math.cos(t), 0.4 * math.sin(t), 0), (-0.25 * math.cos(t), -0.25 * math.sin(t), 0.4), 0.02
                    )
                    for t in (0, 2.1, 4.2)
                ),
            ),
        ]
    return [
        part("wood", box(0.6, 1.1, 0.05, (0, 0, 0.37)), box(0.54, 1.0, 0.03, (0, 0, 0.14)), *_legs(0.52, 1.0, 0.37)),
        part("paper", box(0.2, 0.28, 0.03, (0.05, 0.2, 0.42)), tint=(0.8, 0.3, 0.3)),
    ]


def desk(s: Style) -> Parts:
    drawers = [box(0.02, 0.4, 0.18, (-0.36, 0.5, z)) for z in (0.08, 0.3, 0.5)]
    if s.shape == 1:  # a standing desk of steel and a white top
        return [
            part("paint", box(0.75, 1.5, 0.04, (0, 0, 0.74)), tint=PALETTE["white"]),
            part(
                "iron",
                *(box(0.08, 0.08, 0.74, (0, y, 0)) for y in (-0.6, 0.6)),
                *(box(0.7, 0.08, 0.04, (0, y, 0)) for y in (-0.6, 0.6)),
                box(0.05, 1.2, 0.06, (0, 0, 0.6)),
            ),
        ]
    return [
        part(
            "pale wood",
            box(0.75, 1.6, 0.04, (0, 0, 0.72)),
            box(0.7, 0.46, 0.7, (0, 0.5, 0.02)),
            box(0.7, 0.04, 0.72, (0, -0.76, 0)),
            box(0.03, 1.1, 0.5, (0.33, -0.2, 0.22)),
            tint=s.tint,
        ),
        part("steel", *(box(0.04, 0.12, 0.02, (-0.38, 0.5, z)) for z in (0.2, 0.4, 0.6))),
        part("pale wood", *drawers),
    ]


def office_chair(s: Style) -> Parts:
    star = [rod((0, 0, 0.12), (0.3 * math.cos(t), 0.3 * math.sin(t), 0.07), 0.025) for t in (0, 1.26, 2.51, 3.77, 5.03)]
    castors = [sphere(0.05, (0.3 * math.cos(t), 0.3 * math.sin(t), 0.05)) for t in (0, 1.26, 2.51, 3.77, 5.03)]
    back = box(0.07, 0.44, 0.62, (-0.24, 0, 0.6)) if s.shape == 0 else box(0.06, 0.38, 0.4, (-0.24, 0, 0.62))
    return [
        part(
            "iron",
            *star,
            *castors,
            cylinder(0.03, 0.4, (0, 0, 0.08)),
            box(0.06, 0.08, 0.3, (-0.22, 0, 0.42)),
            *(box(0.26, 0.05, 0.04, (0, y, 0.66)) for y in (-0.27, 0.27)),
            *(box(0.03, 0.03, 0.2, (0, y, 0.47)) for y in (-0.27, 0.27)),
        ),
        part("cloth", box(0.5, 0.5, 0.08, (0, 0, 0.46)), back, tint=s.tint),
    ]


def bed(s: Style) -> Parts:
    pillows = [box(0.4, 0.6, 0.14, (-0.75, y, 0.56)) for y in (-0.38, 0.38)]
    frame = "dark wood" if s.shape == 0 else "pale wood"
    head = box(0.08, 1.7, 1.0, (-1.05, 0, 0)) if s.shape == 0 else box(0.1, 1.7, 0.7, (-1.05, 0, 0))
    posts = [cylinder(0.05, 1.3, (-1.05, y, 0)) for y in (-0.83, 0.83)] if s.shape == 1 else []
    return [
        part(frame, box(2.1, 1.64, 0.3, (0, 0, 0.08)), head, box(0.06, 1.66, 0.5, (1.05, 0, 0)), *posts),
        part("linen", box(2.0, 1.56, 0.2, (0, 0, 0.36)), *pillows),
        part("cloth", box(1.3, 1.68, 0.24, (0.36, 0, 0.36)), tint=s.tint),
    ]


def wardrobe(s: Style) -> Parts:
    doors = [box(0.03, 0.62, 1.85, (0.3, y, 0.12)) for y in (-0.33, 0.33)]
    extra = [part("mirror", box(0.01, 0.4, 1.5, (0.325, 0.33, 0.3)))] if s.shape == 1 else []
    return [
        part("wood", box(0.6, 1.36, 2.05), box(0.66, 1.42, 0.08, (0, 0, 2.05)), tint=s.tint),
        part("wood", *doors, tint=lighter(s)),
        part("brass", *(box(0.05, 0.03, 0.16, (0.32, y, 1.0)) for y in (-0.06, 0.06))),
        *extra,
    ]


def bookcase(s: Style) -> Parts:
    wood = "dark wood" if s.shape == 1 else "wood"
    return [
        part(
            wood,
            box(0.04, 1.1, 2.0, (-0.15, 0, 0)),
            *(box(0.34, 0.05, 2.0, (0, y, 0)) for y in (-0.55, 0.55)),
            *(box(0.34, 1.1, 0.04, (0, 0, z)) for z in (0.0, 1.98)),
            tint=s.tint,
        ),
        part("books", *(box(0.2, 1.04, 0.4 * 0.98, (0.02, 0, 0.05 + 0.4 * i)) for i in range(5))),
    ]


def filing_cabinet(s: Style) -> Parts:
    n = 4 if s.shape == 0 else 3
    gaps = [box(0.02, 0.44, 0.02, (0.31, 0, 0.33 * (i + 1))) for i in range(n - 1)]
    return [
        part("paint", box(0.6, 0.48, 0.33 * n), tint=s.tint),
        part("iron", *gaps, *(box(0.05, 0.16, 0.03, (0.31, 0, 0.33 * i + 0.2)) for i in range(n))),
        part("paper", *(box(0.02, 0.1, 0.05, (0.31, 0, 0.33 * i + 0.25)) for i in range(n))),
    ]


def chest_of_drawers(s: Style) -> Parts:
    fronts = [box(0.03, 0.9, 0.22, (0.24, 0, 0.1 + 0.27 * i)) for i in range(3)]
    return [
        part("wood", box(0.48, 1.0, 0.9, (0, 0, 0.04)), tint=s.tint),
        part("wood", *fronts, tint=lighter(s)),
        part("brass", *(sphere(0.03, (0.28, y, 0.21 + 0.27 * i)) for i in range(3) for y in (-0.25, 0.25))),
    ]


def floor_lamp(s: Style) -> Parts:
    if s.shape == 1:  # an arc
        return [
            part(
                "chrome",
                cylinder(0.18, 0.04),
                *(
                    rod(a, b, 0.02)
                    for a, b in (
                        ((0, 0, 0), (0, 0, 1.4)),
                        ((0, 0, 1.4), (0.3, 0, 1.75)),
                        ((0.3, 0, 1.75), (0.7, 0, 1.7)),
                    )
                ),
            ),
            part("lamp", sphere(0.2, (0.75, 0, 1.6), (1, 1, 0.7))),
        ]
    return [
        part("brass", cylinder(0.16, 0.04), cylinder(0.018, 1.4)),
        part("lamp", lathe(((0.26, 1.35), (0.16, 1.75)), sides=16), lathe(((0, 1.74), (0.16, 1.75)))),
    ]


def bunk_bed(s: Style) -> Parts:
    return [
        part(
            "pale wood",
            *(box(0.08, 0.08, 1.7, (x, y, 0)) for x in (-1.0, 1.0) for y in (-0.45, 0.45)),
            *(box(2.0, 0.9, 0.1, (0, 0, z)) for z in (0.3, 1.2)),
            box(2.0, 0.05, 0.15, (0, 0.45, 1.45)),
            *(box(0.05, 0.4, 0.05, (1.05, 0.1, 0.3 + 0.3 * i)) for i in range(4)),
            tint=s.tint,
        ),
        part("linen", *(box(1.9, 0.84, 0.16, (0, 0, z)) for z in (0.4, 1.3))),
        part("cloth", *(box(1.3, 0.88, 0.2, (0.3, 0, z)) for z in (0.4, 1.3)), tint=PALETTE["light blue"]),
    ]


def stool(s: Style) -> Parts:
    return [
        part("leather", cylinder(0.2, 0.08, (0, 0, 0.7)), tint=s.tint),
        part(
            "chrome",
            *(
                rod((0.24 * math.cos(t), 0.24 * math.sin(t), 0), (0.12 * math.cos(t), 0.12 * math.sin(t), 0.7), 0.018)
                for t in (0.8, 2.4, 3.9, 5.5)
            ),
            lathe(((0.19, 0.25), (0.19, 0.28)), sides=14),
        ),
    ]


def reception_counter(s: Style) -> Parts:
    sign = Picture("bare", s.text or "RECEPTION", (1, 1, 1), s.tint, 5)
    return [
        part("paint", box(0.5, 2.8, 1.05), box(1.2, 0.4, 1.05, (-0.6, 1.2, 0)), tint=s.tint),
        part("pale wood", box(0.66, 2.9, 0.06, (0, 0, 1.05)), box(1.3, 0.5, 0.06, (-0.6, 1.2, 1.05))),
        part("picture", panel(1.7, 0.34, (0.26, 0, 0.5)), picture=sign),
        part("chrome", sphere(0.06, (0.1, -0.7, 1.12))),
    ]


BUILDERS = (
    chair,
    armchair,
    sofa,
    table,
    coffee_table,
    desk,
    office_chair,
    bed,
    wardrobe,
    bookcase,
    filing_cabinet,
    chest_of_drawers,
    floor_lamp,
    bunk_bed,
    stool,
    reception_counter,
)
