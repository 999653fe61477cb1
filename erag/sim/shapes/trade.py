"""What stands in shops, storerooms, museums and hospitals."""

from __future__ import annotations

import math

from erag.sim.mesh import bars, blob, box, cylinder, lathe, panel, prism, rod, sheet, sphere, wheel
from erag.sim.model import PALETTE, Parts, Picture, Style, part


def grocery_shelf(s: Style) -> Parts:
    heading = (
        [
            part(
                "picture",
                panel(1.2, 0.26, (0.1, 0, 1.95)),
                picture=Picture("bare", s.text, (1, 1, 1), (0.1, 0.45, 0.25), 4.6),
            )
        ]
        if s.text
        else []
    )
    return [
        part(
            "steel",
            box(0.06, 2.4, 1.9, (-0.3, 0, 0)),
            *(box(0.6, 2.4, 0.04, (0, 0, z)) for z in (0.1, 1.88)),
            *(box(0.6, 0.04, 1.9, (0, y, 0)) for y in (-1.2, 1.2)),
        ),
        part("goods", box(0.46, 2.34, 1.0, (0.03, 0, 0.16)), box(0.46, 2.34, 0.7, (0.03, 0, 1.17))),
        *heading,
    ]


def freezer(s: Style) -> Parts:
    return [
        part("paint", box(0.9, 2.0, 0.75), tint=PALETTE["white"]),
        part("paint", box(0.92, 2.02, 0.16, (0, 0, 0.2)), tint=s.tint),
        part("glass", box(0.8, 1.9, 0.06, (0, 0, 0.75)), tint=(1.3, 1.3, 1.2)),
        part("goods", sheet(0.7, 1.8, (0, 0, 0.82))),
        part("iron", box(0.06, 2.0, 0.07, (0, 0, 0.78)), *(box(0.9, 0.05, 0.07, (0, y, 0.78)) for y in (-1.0, 0, 1.0))),
        part(
            "picture",
            panel(1.0, 0.22, (0.465, 0, 0.44)),
            picture=Picture("bare", "FROZEN FOOD", (1, 1, 1), (0.1, 0.4, 0.8), 4.6),
        ),
    ]


def checkout(s: Style) -> Parts:
    return [
        part("paint", box(0.7, 2.4, 0.85), tint=s.tint),
        part("rubber", box(0.5, 1.5, 0.03, (0.05, 0.4, 0.85))),
        part("steel", box(0.6, 0.6, 0.03, (0.05, -0.8, 0.85))),
        part("plastic", box(0.3, 0.35, 0.12, (-0.25, -0.6, 0.87)), tint=PALETTE["grey"]),
        part("screen", box(0.03, 0.34, 0.24, (-0.22, -0.6, 1.02)), tint=(0.3, 0.5, 0.8)),
        part("steel", cylinder(0.03, 2.1, (-0.3, 1.0, 0))),
        part(
            "lit picture",
            *(panel(0.36, 0.36, (-0.3 + 0.03 * c, 1.0, 2.0), 90 - 90 * c) for c in (-1, 1)),
            picture=Picture("bare", str(s.seed % 8 + 1), (1, 1, 1), s.tint),
        ),
    ]


def fruit_stand(s: Style) -> Parts:
    tiers = []
    for row, fruit in enumerate(("apples", "oranges", "greens")):
        z = 0.5 + 0.24 * row
        x = 0.5 - 0.42 * row
        tiers += [
            part("rough wood", *(box(0.42, 0.7, 0.18, (x, y, z)) for y in (-0.75, 0, 0.75))),
            part(fruit, *(sphere(0.2, (x, y, z + 0.15), (0.95, 1.6, 0.5)) for y in (-0.75, 0, 0.75))),
        ]
    return [part("wood", prism(((-0.6, 0), (0.7, 0), (0.7, 0.5), (-0.6, 1.0)), 2.3)), *tiers]


def clothes_rail(s: Style) -> Parts:
    colours = ("red", "blue", "white", "black", "yellow", "green", "pink", "grey", "turquoise")
    clothes = [
        part(
            "cloth",
            prism(((-0.24, 0.55), (0.24, 0.55), (0.2, 1.3), (0, 1.42), (-0.2, 1.3)), 0.09, (0, -0.68 + 0.17 * i, 0)),
            tint=PALETTE[c],
        )
        for i, c in enumerate(colours)
    ]
    return [
        part(
            "chrome",
            *(bars(((-0.25, y, 0), (0.25, y, 0)), 0.02) for y in (-0.85, 0.85)),
            *(rod((0, y, 0), (0, y, 1.5), 0.02) for y in (-0.85, 0.85)),
            rod((0, -0.85, 1.5), (0, 0.85, 1.5), 0.02),
        ),
        *clothes,
    ]


def shelving_rack(s: Style) -> Parts:
    post = part(
        "paint",
        *(box(0.1, 0.1, 3.4, (x, y, 0)) for x in (-0.5, 0.5) for y in (-1.4, 1.4)),
        tint=PALETTE["blue"] if s.shape == 0 else PALETTE["green"],
    )
    beam = part(
        "paint",
        *(box(0.08, 2.8, 0.12, (x, 0, z)) for x in (-0.5, 0.5) for z in (0.1, 1.3, 2.5)),
        tint=PALETTE["orange"] if s.shape == 0 else PALETTE["yellow"],
    )
    loads = []
    for z in (0.22, 1.42, 2.62):
        loads += [
            box(0.85, s.rng.uniform(0.6, 0.85), s.rng.uniform(0.5, 0.9), (0, y, z))
            for y in (-0.92, 0, 0.92)
            if s.rng.random() < 0.85
        ]
    return [
        post,
        beam,
        part("rough wood", *(box(1.0, 2.7, 0.05, (0, 0, z)) for z in (0.17, 1.37, 2.57))),
        part("cardboard", *(loads or [box(0.8, 0.8, 0.6, (0, 0, 0.22))])),
    ]


def pallet(s: Style) -> Parts:
    wood = [box(0.12, 1.2, 0.03, (x, 0, 0.12)) for x in (-0.44, -0.22, 0, 0.22, 0.44)] + [
        box(1.0, 0.1, 0.1, (0, y, 0.02)) for y in (-0.5, 0, 0.5)
    ]
    load = [
        box(0.5, 0.58, 0.38, (x, y, 0.15 + 0.39 * k))
        for x in (-0.26, 0.26)
        for y in (-0.3, 0.3)
        for k in range(2 if s.shape == 0 else 3)
    ]
    if s.shape == 2:
        return [part("rough wood", *(m.moved(0, 0, 0.15 * i) for m in wood for i in range(6)))]
    return [
        part("rough wood", *wood),
        part("cardboard", *load),
        part(
            "paper",
            *(box(1.03, 0.06, 0.01, (0, y, 0.93)) for y in (-0.3, 0.3)),
            *(panel(0.16, 0.12, (0.515, y, 0.3)) for y in (-0.3, 0.3)),
        ),
    ]


def cardboard_box(s: Style) -> Parts:
    flaps = (
        [
            box(0.24, 0.5, 0.015, (0, 0, 0)).turned(-35, "y").moved(0.36, 0, 0.44),
            box(0.24, 0.5, 0.015, (0, 0, 0)).turned(35, "y").moved(-0.36, 0, 0.44),
        ]
        if s.shape == 1
        else []
    )
    return [
        part("cardboard", box(0.5, 0.5, 0.4), *flaps, tint=(1, 1, 1) if s.shape == 0 else (0.92, 0.86, 0.8)),
        part("paper", box(0.51, 0.07, 0.405), tint=(0.85, 0.75, 0.55)),
        part("picture", panel(0.22, 0.16, (0.255, 0.1, 0.16)), picture=Picture("bare", "THIS SIDE\nUP", aspect=1.4)),
    ]


def barrel(s: Style) -> Parts:
    if s.shape == 1:  # wood with hoops
        return [
            part("planks", lathe(((0.26, 0), (0.34, 0.45), (0.26, 0.9), (0, 0.88)))),
            part(
                "iron",
                *(lathe(((r, z), (r, z + 0.06))) for r, z in ((0.285, 0.1), (0.33, 0.3), (0.33, 0.58), (0.285, 0.76))),
            ),
        ]
    return [
        part(
            "paint",
            cylinder(0.3, 0.9, sides=18),
            *(cylinder(0.315, 0.03, (0, 0, z), sides=18) for z in (0.02, 0.3, 0.58, 0.86)),
            tint=s.tint,
        )
    ]


def ladder(s: Style) -> Parts:
    rails = [rod((0.45, y * 1.15, 0), (0, y * 0.8, 2.1), 0.03) for y in (-0.28, 0.28)] + [
        rod((-0.45, y * 1.15, 0), (0, y * 0.8, 2.1), 0.025) for y in (-0.28, 0.28)
    ]
    rungs = [box(0.1, 0.52 - 0.02 * i, 0.03, (0.45 - 0.063 * i, 0, 0.3 * i)) for i in range(1, 7)]
    return [
        part("wood" if s.shape == 1 else "metal", *rails, *rungs, box(0.3, 0.5, 0.04, (0, 0, 2.08))),
        part("plastic", *(cylinder(0.045, 0.05, (0.45, y, 0)) for y in (-0.32, 0.32)), tint=PALETTE["red"]),
    ]


def workbench(s: Style) -> Parts:
    tools = [
        part(
            "steel",
            *(box(0.02, 0.05, 0.26, (-0.3, y, 1.25)) for y in (-0.6, -0.4, -0.2)),
            box(0.02, 0.5, 0.16, (-0.3, 0.3, 1.3)),
        ),
        part("plastic", *(box(0.03, 0.06, 0.14, (-0.3, y, 1.15)) for y in (-0.6, -0.4, -0.2)), tint=PALETTE["red"]),
    ]
    return [
        part("pale wood", box(0.75, 1.8, 0.09, (0, 0, 0.8))),
        part(
            "paint",
            *(box(0.1, 0.1, 0.8, (x, y, 0)) for x in (-0.3, 0.3) for y in (-0.8, 0.8)),
            box(0.6, 0.5, 0.5, (0, 0.5, 0.2)),
            tint=s.tint,
        ),
        part("rough wood", box(0.04, 1.8, 0.75, (-0.34, 0, 0.95))),
        *tools,
        part("iron", box(0.22, 0.14, 0.16, (0.3, -0.6, 0.89)), rod((0.42, -0.68, 0.98), (0.42, -0.5, 0.98), 0.015)),
    ]


def display_case(s: Style) -> Parts:
    posts = [box(0.04, 0.04, 1.0, (x, y, 0.8)) for x in (-0.38, 0.38) for y in (-0.58, 0.58)]
    exhibit = (
        lathe(((0.1, 0), (0.22, 0.18), (0.16, 0.42), (0.08, 0.5), (0.12, 0.56)))
        if s.shape == 0
        else blob(0.24, (0, 0, 0.24), s.rng)
    )
    return [
        part(
            "dark wood" if s.shape == 0 else "paint",
            box(0.84, 1.24, 0.8),
            box(0.84, 1.24, 0.06, (0, 0, 1.8)),
            tint=(1, 1, 1) if s.shape == 0 else PALETTE["white"],
        ),
        part("brass" if s.shape == 0 else "steel", *posts),
        part("linen", box(0.5, 0.5, 0.08, (0, 0, 0.8))),
        part("bronze" if s.seed % 2 else "paint", exhibit.moved(0, 0, 0.88), tint=s.tint),
        part("picture", panel(0.4, 0.16, (0.43, 0, 0.5)), picture=Picture("lines", "EXHIBIT", aspect=2.2)),
    ]


def bust(s: Style) -> Parts:
    stone = "marble" if s.shape == 0 else "bronze"
    head = [
        sphere(0.15, (0.02, 0, 1.55), (1, 0.85, 1.25)),
        sphere(0.04, (0.17, 0, 1.53)),
        cylinder(0.075, 0.2, (0, 0, 1.28)),
        lathe(((0.12, 1.06), (0.3, 1.18), (0.26, 1.3), (0.08, 1.36))).scaled(0.7, 1, 1),
        sphere(0.155, (-0.03, 0, 1.62), (1, 0.9, 1.05)),
    ]
    return [
        part("stone", box(0.5, 0.5, 0.12), box(0.36, 0.36, 0.85, (0, 0, 0.12)), box(0.46, 0.46, 0.08, (0, 0, 0.97))),
        part(stone, *head),
        part("brass", box(0.02, 0.24, 0.1, (0.185, 0, 0.6))),
    ]


def rope_barrier(s: Style) -> Parts:
    posts = (
        [cylinder(0.03, 0.95, (0, y, 0)) for y in (-0.9, 0.9)]
        + [cylinder(0.16, 0.04, (0, y, 0)) for y in (-0.9, 0.9)]
        + [sphere(0.055, (0, y, 0.97)) for y in (-0.9, 0.9)]
    )
    sag = bars([(0, -0.9 + 0.3 * i, 0.88 - 0.26 * math.sin(math.pi * i / 6)) for i in range(7)], 0.035)
    return [part("brass", *posts), part("cloth", sag, tint=s.tint)]


def hospital_bed(s: Style) -> Parts:
    rails = [bars(((-0.3, y, 0.62), (-0.3, y, 0.85), (0.5, y, 0.85), (0.5, y, 0.62)), 0.018) for y in (-0.48, 0.48)]
    mattress = [
        box(1.3, 0.86, 0.14, (0.35, 0, 0.56)),
        box(0.8, 0.86, 0.14, (0, 0, 0))
        .turned(32 if s.shape == 0 else 8, "y")
        .moved(-0.62, 0, 0.72 if s.shape == 0 else 0.6),
    ]
    return [
        part("chrome", *rails, *(cylinder(0.03, 0.45, (x, y, 0.08)) for x in (-0.8, 0.8) for y in (-0.35, 0.35))),
        part("steel", box(2.0, 0.9, 0.08, (0, 0, 0.48))),
        part(
            "plastic",
            box(0.06, 0.95, 0.55, (-1.05, 0, 0.5)),
            box(0.06, 0.95, 0.4, (1.05, 0, 0.45)),
            tint=PALETTE["cream"],
        ),
        part("linen", *mattress, box(0.32, 0.6, 0.12, (-0.78, 0, 0.95 if s.shape == 0 else 0.72))),
        part("cloth", box(1.1, 0.9, 0.17, (0.45, 0, 0.56)), tint=s.tint),
        part("rubber", *(wheel(0.08, 0.05, (x, y, 0.08)) for x in (-0.8, 0.8) for y in (-0.35, 0.35))),
    ]


def drip_stand(s: Style) -> Parts:
    feet = [rod((0, 0, 0.1), (0.28 * math.cos(t), 0.28 * math.sin(t), 0.06), 0.02) for t in (0, 1.26, 2.51, 3.77, 5.03)]
    return [
        part("chrome", *feet, cylinder(0.018, 1.9), rod((0, -0.18, 1.88), (0, 0.18, 1.88), 0.014)),
        part(
            "plastic",
            box(0.05, 0.14, 0.26, (0, -0.16, 1.58)),
            box(0.05, 0.14, 0.26, (0, 0.16, 1.58)),
            tint=(0.86, 0.93, 0.98),
        ),
        part("plastic", box(0.12, 0.2, 0.26, (0.06, 0, 1.05)), tint=s.tint),
        part("screen", box(0.01, 0.12, 0.08, (0.125, 0, 1.2)), tint=(0.3, 0.9, 0.5)),
        part("glass", bars(((0, -0.16, 1.58), (0.06, -0.1, 1.3), (0.06, 0, 1.2)), 0.01, 5)),
    ]


def privacy_screen(s: Style) -> Parts:
    folds = [box(0.03, 0.6, 1.5, (0.1 * (-1) ** i, -0.6 + 0.6 * i, 0.2)).turned(0) for i in range(3)]
    return [
        part("cloth", *folds, tint=s.tint),
        part(
            "chrome",
            *(
                rod((0.1 * (-1) ** i, y, 0), (0.1 * (-1) ** i, y, 1.75), 0.02)
                for i in range(3)
                for y in (-0.9 + 0.6 * i, -0.3 + 0.6 * i)
            ),
            *(
                rod((0.1 * (-1) ** i, -0.9 + 0.6 * i, 1.74), (0.1 * (-1) ** i, -0.3 + 0.6 * i, 1.74), 0.02)
                for i in range(3)
            ),
        ),
    ]


def patient_monitor(s: Style) -> Parts:
    return [
        part("steel", cylinder(0.025, 1.2), cylinder(0.24, 0.05)),
        part("plastic", box(0.16, 0.46, 0.36, (0, 0, 1.15)), box(0.24, 0.3, 0.12, (0, 0, 0.75)), tint=s.tint),
        part("lit picture", panel(0.4, 0.28, (0.085, 0, 1.19)), picture=Picture("monitor", aspect=1.4, seed=s.seed)),
    ]


def medicine_cabinet(s: Style) -> Parts:
    return [
        part("paint", box(0.45, 0.95, 1.85), tint=PALETTE["white"]),
        part("glass", *(box(0.02, 0.4, 0.95, (0.225, y, 0.8)) for y in (-0.23, 0.23)), tint=(1.2, 1.2, 1.2)),
        part("goods", *(box(0.015, 0.36, 0.4, (0.235, y, z)) for y in (-0.23, 0.23) for z in (0.85, 1.3))),
        part("picture", panel(0.3, 0.3, (0.24, 0, 0.3)), picture=Picture("cross", ink=s.tint)),
        part("steel", *(box(0.03, 0.02, 0.14, (0.24, y, 1.15)) for y in (-0.03, 0.03))),
    ]


BUILDERS = (
    grocery_shelf,
    freezer,
    checkout,
    fruit_stand,
    clothes_rail,
    shelving_rack,
    pallet,
    cardboard_box,
    barrel,
    ladder,
    workbench,
    display_case,
    bust,
    rope_barrier,
    hospital_bed,
    drip_stand,
    privacy_screen,
    patient_monitor,
    medicine_cabinet,
)
