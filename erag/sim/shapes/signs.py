"""Signs, notices and safety equipment; what is written on them can be read."""

from __future__ import annotations

from erag.sim.mesh import bars, box, cylinder, lathe, panel, prism, rod
from erag.sim.model import PALETTE, Parts, Picture, Style, part

RED, BLUE, GREEN, WHITE = (0.75, 0.05, 0.05), (0.08, 0.25, 0.62), (0.05, 0.4, 0.2), (1.0, 1.0, 1.0)


def stop_sign(s: Style) -> Parts:
    plate = cylinder(0.42, 0.03, sides=8).turned(22.5).turned(90, "y").moved(0.03, 0, 2.3)
    return [
        part("steel", cylinder(0.04, 2.6)),
        part("paint", plate, tint=RED),
        part("picture", panel(0.62, 0.26, (0.065, 0, 2.17)), picture=Picture("bare", "STOP", WHITE, RED, 2.4)),
    ]


def direction_sign(s: Style) -> Parts:
    names = (s.text or "STATION|MARKET|PARK").split("|")
    ground = BLUE if s.shape == 0 else GREEN
    arms = []
    for i, name in enumerate(names[:3]):
        y = 0.55 if i % 2 == 0 else -0.55
        arms.append(
            part(
                "picture",
                panel(1.1, 0.26, (0.07, y, 2.35 - 0.34 * i)),
                panel(1.1, 0.26, (-0.07, y, 2.35 - 0.34 * i), 180),
                picture=Picture("text", name, WHITE, ground, 4.2),
            )
        )
    return [part("steel", cylinder(0.05, 2.75)), *arms]


def speed_limit_sign(s: Style) -> Parts:
    disc = cylinder(0.36, 0.03, sides=20).turned(90, "y").moved(0.03, 0, 2.2)
    inner = cylinder(0.29, 0.01, sides=20).turned(90, "y").moved(0.06, 0, 2.2)
    return [
        part("steel", cylinder(0.04, 2.5)),
        part("paint", disc, tint=RED),
        part("paint", inner),
        part(
            "picture",
            panel(0.36, 0.3, (0.075, 0, 2.05)),
            picture=Picture("bare", s.text or "30", ground=PALETTE["white"], aspect=1.2),
        ),
    ]


def parking_sign(s: Style) -> Parts:
    return [
        part("steel", cylinder(0.04, 2.5)),
        part("picture", panel(0.7, 0.7, (0.05, 0, 1.9)), picture=Picture("text", "P", WHITE, BLUE)),
        part("paint", box(0.03, 0.74, 0.74, (0.02, 0, 1.88)), tint=BLUE),
        *(
            [part("picture", panel(0.7, 0.24, (0.05, 0, 1.6)), picture=Picture("text", s.text, aspect=2.9))]
            if s.text
            else []
        ),
    ]


def billboard(s: Style) -> Parts:
    text = s.text or "SUMMER\nCONCERTS"
    picture = Picture("text", text, WHITE, s.tint, 1.8)
    return [
        part("steel", *(cylinder(0.12, 2.0, (0, y, 0)) for y in (-1.4, 1.4))),
        part("iron", box(0.2, 4.2, 2.5, (0, 0, 1.8))),
        part("lit picture", panel(4.0, 2.3, (0.11, 0, 1.9)), panel(4.0, 2.3, (-0.11, 0, 1.9), 180), picture=picture),
    ]


def information_board(s: Style) -> Parts:
    return [
        part(
            "wood",
            *(box(0.1, 0.1, 2.0, (0, y, 0)) for y in (-0.75, 0.75)),
            box(0.08, 1.6, 1.15, (0, 0, 0.8)),
            prism(((-0.3, 2.0), (0.3, 2.0), (0, 2.2)), 2.0),
        ),
        part(
            "picture",
            panel(1.4, 1.05, (0.05, 0, 0.85)),
            picture=Picture("plan", s.text or "MAP", aspect=1.33, seed=s.seed),
        ),
    ]


def notice_board(s: Style) -> Parts:
    return [
        part("wood", box(0.05, 1.5, 1.0)),
        part("picture", panel(1.42, 0.92, (0.03, 0, 0.04)), picture=Picture("notices", aspect=1.5, seed=s.seed)),
    ]


def menu_board(s: Style) -> Parts:
    left = panel(0.62, 0.95, (0, 0, 0)).turned(-14, "y").moved(0.22, 0, 0.05)
    frame = [
        box(0.04, 0.7, 1.1).turned(-14, "y").moved(0.2, 0, 0),
        box(0.04, 0.7, 1.1).turned(14, "y").moved(-0.2, 0, 0),
    ]
    return [
        part("wood", *frame),
        part("picture", left, picture=Picture("lines", s.text or "MENU", (0.95, 0.95, 0.85), (0.14, 0.17, 0.16), 0.66)),
    ]


def exit_sign(s: Style) -> Parts:
    return [
        part("paint", box(0.06, 0.56, 0.28), tint=GREEN),
        part("lit picture", panel(0.54, 0.26, (0.035, 0, 0.01)), picture=Picture("exit", aspect=2.1)),
    ]


def fire_extinguisher(s: Style) -> Parts:
    hose = bars(((0.05, 0, 0.62), (0.14, 0.05, 0.6), (0.16, 0.08, 0.3)), 0.02)
    return [
        part("paint", lathe(((0.09, 0), (0.1, 0.03), (0.1, 0.45), (0.05, 0.54), (0.03, 0.56))), tint=RED),
        part("rubber", cylinder(0.03, 0.08, (0, 0, 0.55)), box(0.16, 0.03, 0.03, (0.03, 0, 0.63)), hose),
        part("picture", panel(0.12, 0.16, (0.103, 0, 0.2)), picture=Picture("lines", "FIRE", aspect=0.75)),
        part("paint", box(0.02, 0.3, 0.3, (-0.1, 0, 0.85)), tint=RED),
        part("picture", panel(0.24, 0.24, (-0.085, 0, 0.88)), picture=Picture("bare", "FIRE", WHITE, RED)),
    ]


def defibrillator(s: Style) -> Parts:
    return [
        part("plastic", box(0.2, 0.42, 0.5), tint=GREEN if s.shape == 0 else PALETTE["yellow"]),
        part(
            "picture",
            panel(0.36, 0.26, (0.105, 0, 0.2)),
            picture=Picture("bare", "AED", WHITE, GREEN if s.shape == 0 else (0.7, 0.1, 0.1), 1.4),
        ),
        part("picture", panel(0.14, 0.14, (0.105, 0, 0.04)), picture=Picture("cross", ink=WHITE, ground=GREEN)),
    ]


def warning_sign(s: Style) -> Parts:
    frame = [
        box(0.02, 0.44, 0.75).turned(-16, "y").moved(0.18, 0, 0),
        box(0.02, 0.44, 0.75).turned(16, "y").moved(-0.18, 0, 0),
    ]
    return [
        part("plastic", *frame, tint=PALETTE["yellow"]),
        part(
            "picture",
            panel(0.4, 0.5).turned(-16, "y").moved(0.17, 0, 0.14),
            picture=Picture("bare", s.text or "WET\nFLOOR", (0.1, 0.1, 0.1), PALETTE["yellow"], 0.8),
        ),
    ]


def road_barrier(s: Style) -> Parts:
    return [
        part(
            "red bands",
            box(0.06, 0.24, 1.8).turned(90, "x").moved(0, 0.9, 0.75),
            box(0.06, 0.2, 1.8).turned(90, "x").moved(0, 0.9, 0.35),
        ),
        part(
            "paint",
            *(rod((x, y, 0), (0, y, 1.0), 0.03) for x in (-0.3, 0.3) for y in (-0.75, 0.75)),
            tint=PALETTE["orange"],
        ),
        part("lamp", *(cylinder(0.08, 0.16, (0, y, 1.0)) for y in (-0.75, 0.75)), tint=(1, 0.6, 0.1)),
    ]


BUILDERS = (
    stop_sign,
    direction_sign,
    speed_limit_sign,
    parking_sign,
    billboard,
    information_board,
    notice_board,
    menu_board,
    exit_sign,
    fire_extinguisher,
    defibrillator,
    warning_sign,
    road_barrier,
)
