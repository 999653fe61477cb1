"""Pictures drawn on faces: lettering on signs, clock faces, screens, paintings, notices."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from erag.sim.model import PALETTE, Picture, Tint

HEIGHT = 160  # pixels of a picture; the width follows its aspect, within WIDEST
WIDEST = 640
Draw = ImageDraw.ImageDraw
Rng = np.random.Generator


def draw(picture: Picture) -> Image.Image:
    """The picture as an RGB image, the same for the same `picture`."""
    width = int(np.clip(HEIGHT * picture.aspect, 48, WIDEST))
    height = HEIGHT if width < WIDEST else max(32, int(WIDEST / picture.aspect))
    image = Image.new("RGB", (width, height), rgb(picture.ground))
    MOTIFS[picture.motif](ImageDraw.Draw(image), width, height, picture, np.random.default_rng(picture.seed))
    return image


def rgb(tint: Tint) -> tuple[int, int, int]:
    """A tint as bytes."""
    return (int(tint[0] * 255), int(tint[1] * 255), int(tint[2] * 255))


def lettered(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """The text, as large as fits, with a thin border."""
    d.rectangle((3, 3, w - 4, h - 4), outline=rgb(p.ink), width=3)
    _write(d, p.text, (w * 0.06, h * 0.1, w * 0.94, h * 0.9), rgb(p.ink))


def bare(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """The text without a border."""
    _write(d, p.text, (w * 0.04, h * 0.06, w * 0.96, h * 0.94), rgb(p.ink))


def _write(d: Draw, text: str, within: tuple[float, float, float, float], ink: tuple[int, int, int]) -> None:
    x0, y0, x1, y1 = within
    size = 8
    for bigger in range(8, HEIGHT * 2, 2):
        box = d.multiline_textbbox((0, 0), text, font=ImageFont.load_default(bigger), align="center")
        if box[2] - box[0] > x1 - x0 or box[3] - box[1] > y1 - y0:
            break
        size = bigger
    font = ImageFont.load_default(size)
    d.multiline_text(((x0 + x1) / 2, (y0 + y1) / 2), text, ink, font, "mm", align="center", stroke_width=size // 24)


def clock(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A dial with twelve strokes and two hands."""
    r = min(w, h) / 2 - 4
    cx, cy = w / 2, h / 2
    d.ellipse((cx - r, cy - r, cx + r, cy + r), fill=(250, 248, 240), outline=(30, 30, 30), width=7)
    for hour in range(12):
        s, c = math.sin(hour * math.pi / 6), -math.cos(hour * math.pi / 6)
        d.line((cx + s * r * 0.76, cy + c * r * 0.76, cx + s * r * 0.9, cy + c * r * 0.9), (20, 20, 20), 6)
    for turn, length, width in ((rng.random(), 0.5, 8), (rng.random(), 0.72, 5)):
        s, c = math.sin(turn * 2 * math.pi), -math.cos(turn * 2 * math.pi)
        d.line((cx, cy, cx + s * r * length, cy + c * r * length), (15, 15, 15), width)


def desktop(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A computer's screen: a window with lines of text and a bar."""
    d.rectangle((0, 0, w, h), (36, 84, 140))
    d.rectangle((w * 0.1, h * 0.1, w * 0.82, h * 0.82), (246, 247, 250))
    d.rectangle((w * 0.1, h * 0.1, w * 0.82, h * 0.2), (200, 206, 216))
    for i in range(8):
        y = h * (0.26 + 0.065 * i)
        d.line((w * 0.15, y, w * rng.uniform(0.4, 0.76), y), (70, 80, 96), 4)
    d.rectangle((0, h * 0.92, w, h), (20, 30, 46))


def broadcast(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A television picture: a pitch or a landscape."""
    sky, land = ((110, 170, 230), (60, 140, 60)) if rng.random() < 0.5 else ((240, 170, 110), (90, 70, 110))
    d.rectangle((0, 0, w, h * 0.5), sky)
    d.rectangle((0, h * 0.5, w, h), land)
    for _ in range(7):
        x, y = rng.uniform(0.1, 0.9) * w, rng.uniform(0.55, 0.85) * h
        d.ellipse((x - 5, y - 12, x + 5, y + 12), rgb(list(PALETTE.values())[int(rng.integers(0, 6))]))
    d.rectangle((0, h * 0.9, w, h), (190, 20, 30))


def landscape(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A painting of hills, a sun and a tree in a gilt frame."""
    d.rectangle((0, 0, w, h), tuple(int(v) for v in rng.integers(130, 235, 3)))
    d.ellipse((w * 0.65, h * 0.12, w * 0.85, h * 0.12 + w * 0.2), (250, 220, 120))
    for i in range(3):
        base = h * (0.5 + 0.14 * i)
        ridge = [(x, base + h * 0.1 * math.sin(x / w * 6 + rng.uniform(0, 6))) for x in range(0, w + 8, 8)]
        d.polygon([*ridge, (w, h), (0, h)], tuple(int(v) for v in rng.integers(50, 150, 3)))
    d.rectangle((w * 0.24, h * 0.42, w * 0.27, h * 0.72), (74, 50, 34))
    d.ellipse((w * 0.14, h * 0.2, w * 0.37, h * 0.55), (44, 96, 48))
    _frame(d, w, h, (176, 136, 56))


def portrait(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A painted head and shoulders in a frame."""
    d.rectangle((0, 0, w, h), tuple(int(v) for v in rng.integers(40, 110, 3)))
    d.ellipse((w * 0.14, h * 0.6, w * 0.86, h * 1.3), tuple(int(v) for v in rng.integers(40, 190, 3)))
    d.ellipse((w * 0.3, h * 0.16, w * 0.7, h * 0.66), (70, 46, 30))
    d.ellipse((w * 0.34, h * 0.22, w * 0.66, h * 0.66), (222, 178, 146))
    for x in (0.43, 0.57):
        d.ellipse((w * x - 4, h * 0.4 - 4, w * x + 4, h * 0.4 + 4), (40, 30, 30))
    d.arc((w * 0.43, h * 0.46, w * 0.57, h * 0.57), 20, 160, (150, 50, 50), 4)
    _frame(d, w, h, (96, 62, 34))


def abstract(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """Coloured planes between black bars."""
    d.rectangle((0, 0, w, h), (244, 242, 236))
    xs, ys = sorted(rng.uniform(0.1, 0.9, 3) * w), sorted(rng.uniform(0.1, 0.9, 3) * h)
    for x0, x1 in zip([0, *xs], [*xs, w], strict=True):
        for y0, y1 in zip([0, *ys], [*ys, h], strict=True):
            if rng.random() < 0.4:
                d.rectangle((x0, y0, x1, y1), [(206, 30, 40), (30, 70, 170), (240, 200, 40)][int(rng.integers(0, 3))])
    for x in xs:
        d.line((x, 0, x, h), (15, 15, 15), 6)
    for y in ys:
        d.line((0, y, w, y), (15, 15, 15), 6)
    _frame(d, w, h, (20, 20, 22))


def _frame(d: Draw, w: int, h: int, colour: tuple[int, int, int]) -> None:
    d.rectangle((0, 0, w - 1, h - 1), outline=colour, width=max(8, h // 14))


def notices(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """Sheets of paper pinned to a board."""
    d.rectangle((0, 0, w, h), (176, 132, 84))
    for i in range(8):
        x, y = (i % 4 + 0.12) * w / 4, (i // 4 + 0.1) * h / 2
        x1, y1 = x + w / 4 * rng.uniform(0.6, 0.8), y + h / 2 * rng.uniform(0.6, 0.82)
        d.rectangle((x, y, x1, y1), [(252, 250, 240), (250, 240, 130), (190, 220, 250), (250, 190, 190)][i % 4])
        for line in range(5):
            d.line((x + 5, y + 12 + 9 * line, x1 - 6, y + 12 + 9 * line), (70, 70, 80), 2)
    _frame(d, w, h, (110, 74, 40))


def plan(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A map with streets, a park, a river, and the heading MAP."""
    d.rectangle((0, 0, w, h), (240, 234, 214))
    d.rectangle((w * 0.1, h * 0.35, w * 0.4, h * 0.7), (150, 200, 130))
    d.line((0, h * 0.9, w * 0.5, h * 0.75, w, h * 0.86), (110, 170, 220), 12)
    for x in (0.45, 0.68, 0.86):
        d.line((w * x, h * 0.26, w * (x - 0.05), h), (250, 160, 60), 5)
    for y in (0.45, 0.62):
        d.line((0, h * y, w, h * (y + 0.05)), (255, 255, 255), 6)
    d.ellipse((w * 0.52, h * 0.5, w * 0.57, h * 0.5 + w * 0.05), (210, 30, 30))
    _write(d, p.text or "MAP", (w * 0.1, 4, w * 0.9, h * 0.22), (30, 60, 120))
    _frame(d, w, h, (60, 66, 74))


def board(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A board written on with markers or chalk: a sum, a curve, boxes; `ink` is the chalk."""
    ink = rgb(p.ink)
    _write(d, p.text or "a + b = c", (w * 0.06, h * 0.1, w * 0.5, h * 0.35), ink)
    curve = [(x, h * (0.7 - 0.18 * math.sin(x / w * 12))) for x in range(int(w * 0.08), int(w * 0.5), 6)]
    d.line(curve, ink, 4)
    for i in range(3):
        d.rectangle((w * (0.58 + 0.13 * i), h * 0.35, w * (0.67 + 0.13 * i), h * 0.6), outline=ink, width=4)
    _frame(d, w, h, (150, 152, 156))


def cross(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A cross in the ink colour."""
    d.rectangle((w * 0.4, h * 0.16, w * 0.6, h * 0.84), rgb(p.ink))
    d.rectangle((w * 0.16, h * 0.4, w * 0.84, h * 0.6), rgb(p.ink))


def exit_(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A green emergency exit sign."""
    d.rectangle((0, 0, w, h), (10, 130, 70))
    _write(d, "EXIT", (w * 0.08, h * 0.12, w * 0.62, h * 0.88), (250, 255, 250))
    d.polygon([(w * 0.68, h * 0.4), (w * 0.8, h * 0.4), (w * 0.8, h * 0.22), (w * 0.95, h / 2), (w * 0.8, h * 0.78),
               (w * 0.8, h * 0.6), (w * 0.68, h * 0.6)], (250, 255, 250))  # fmt: skip


def vending(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """The front of a drinks machine: rows of cans behind glass, a slot, a heading."""
    d.rectangle((0, 0, w, h), rgb(p.ground))
    _write(d, p.text or "DRINKS", (w * 0.1, h * 0.02, w * 0.9, h * 0.14), (255, 255, 255))
    d.rectangle((w * 0.08, h * 0.16, w * 0.7, h * 0.8), (225, 235, 240))
    for row in range(5):
        for column in range(5):
            x, y = w * (0.1 + 0.12 * column), h * (0.18 + 0.124 * row)
            colour = list(PALETTE.values())[int(rng.integers(0, 6))]
            d.rectangle((x, y, x + w * 0.08, y + h * 0.095), rgb(colour))
    d.rectangle((w * 0.76, h * 0.3, w * 0.92, h * 0.5), (30, 34, 40))
    d.rectangle((w * 0.14, h * 0.86, w * 0.66, h * 0.95), (20, 20, 24))


def shopfront(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A shop window: panes, a door, things on show."""
    d.rectangle((0, 0, w, h), rgb(p.ground))
    for x0, x1 in ((0.04, 0.34), (0.52, 0.96)):
        d.rectangle((w * x0, h * 0.08, w * x1, h * 0.86), (120, 150, 168))
        d.rectangle((w * x0, h * 0.66, w * x1, h * 0.86), (206, 186, 150))
        for _ in range(6):
            x = w * rng.uniform(x0 + 0.02, x1 - 0.06)
            d.rectangle((x, h * rng.uniform(0.4, 0.6), x + w * 0.035, h * 0.7),
                        rgb(list(PALETTE.values())[int(rng.integers(0, 12))]))  # fmt: skip
        d.line((w * (x0 + 0.04), h * 0.5, w * (x0 + 0.12), h * 0.14), (196, 214, 226), 4)
    d.rectangle((w * 0.37, h * 0.1, w * 0.49, h), (60, 44, 34))
    d.rectangle((w * 0.385, h * 0.16, w * 0.475, h * 0.6), (150, 176, 190))


def lines(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A page: a heading and lines of print."""
    _write(d, p.text or "INFORMATION", (w * 0.08, h * 0.05, w * 0.92, h * 0.24), rgb(p.ink))
    for i in range(9):
        y = h * (0.32 + 0.07 * i)
        d.line((w * 0.1, y, w * rng.uniform(0.6, 0.9), y), rgb(p.ink), 3)


def monitor(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A patient monitor: green and yellow curves on black."""
    d.rectangle((0, 0, w, h), (8, 12, 16))
    for row, colour in enumerate(((60, 240, 90), (240, 220, 60), (80, 190, 250))):
        y = h * (0.25 + 0.25 * row)
        points = [(x, y - (h * 0.16 if x % 44 < 6 else 0)) for x in range(6, int(w * 0.7), 5)]
        d.line(points, colour, 4)
        _write(d, str(int(rng.integers(60, 120))), (w * 0.74, y - h * 0.12, w * 0.97, y + h * 0.08), colour)


def letters(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """An eye test: rows of letters that get smaller."""
    for row, (text, size) in enumerate((("E", 0.3), ("F P", 0.2), ("T O Z", 0.14), ("L P E D", 0.1))):
        top = h * (0.05, 0.36, 0.58, 0.76)[row]
        _write(d, text, (0, top, w, top + h * size), (10, 10, 10))


def keys(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """Piano keys from left to right."""
    d.rectangle((0, 0, w, h), (250, 250, 246))
    step = w / 28
    for i in range(28):
        d.line((i * step, 0, i * step, h), (120, 120, 120), 2)
        if i % 7 not in (0, 3):
            d.rectangle((i * step - step * 0.3, 0, i * step + step * 0.3, h * 0.6), (12, 12, 12))


def window(d: Draw, w: int, h: int, p: Picture, rng: Rng) -> None:
    """A window: pale sky over distant trees, in a white frame with a cross bar."""
    d.rectangle((0, 0, w, h), (206, 226, 244))
    for i in range(12):
        x, top = w * i / 11, h * (0.62 + 0.08 * math.sin(i * 1.7))
        d.ellipse((x - w * 0.07, top, x + w * 0.07, h * 1.1), (126, 156, 128))
    for x in (0.0, 0.48, 0.96):
        d.rectangle((w * x, 0, w * (x + 0.04), h), (250, 250, 248))
    for y in (0.0, 0.94):
        d.rectangle((0, h * y, w, h * (y + 0.06)), (250, 250, 248))


MOTIFS: Mapping[str, Callable[[Draw, int, int, Picture, Rng], None]] = {
    "text": lettered, "bare": bare, "clock": clock, "desktop": desktop, "broadcast": broadcast, "landscape": landscape,
    "portrait": portrait, "abstract": abstract, "notices": notices, "plan": plan, "board": board, "cross": cross,
    "exit": exit_, "vending": vending, "shopfront": shopfront, "lines": lines, "monitor": monitor, "letters": letters,
    "keys": keys, "window": window,
}  # fmt: skip
