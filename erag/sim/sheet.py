"""Contact sheets: a picture of every class, of every look, or of a world's frames, to be looked at by a person."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from erag.sim.camera import FIELD_OF_VIEW, Camera, Size
from erag.sim.mesh import bounds, sheet
from erag.sim.model import Parts, Style, part
from erag.sim.renderer import Lamp, Renderer, Solid
from erag.sim.shapes import BUILDERS
from erag.sim.vocabulary import classes

_GROUND = part("concrete", sheet(60, 60))


def portrait(renderer: Renderer, parts: Parts, size: Size, turn: float = 32.0) -> Image.Image:
    """The object made of `parts` from its front, a little from the side and above."""
    low, high = bounds([p.mesh for p in parts])
    centre = (low + high) / 2
    reach = float(np.linalg.norm(high - low)) / 2 / math.sin(math.radians(FIELD_OF_VIEW / 2)) * 0.95 + 0.1
    yaw = math.radians(180 + turn)
    eye = centre - reach * np.array((math.cos(yaw) * 0.95, math.sin(yaw) * 0.95, -0.3))
    renderer.load([Solid((_GROUND,)), Solid(tuple(parts))], (0, 1))
    camera = Camera(float(eye[0]), float(eye[1]), max(0.2, float(eye[2])), yaw, -17.0)
    frame = renderer.draw(camera, size, Lamp())
    rgb = frame.rgb.copy()
    rgb[frame.sky] = (214, 226, 238)
    return Image.fromarray(rgb)


def classes_sheet(names: Sequence[str], styles: Sequence[Style], columns: int, size: Size) -> Image.Image:
    """One picture a class, with its name below."""
    with Renderer() as renderer:
        shots = [portrait(renderer, BUILDERS[n](s), size) for n, s in zip(names, styles, strict=True)]
    return tiled(shots, names, columns)


def class_page(split: str) -> Image.Image:
    """All classes in their first look in the worlds of `split`."""
    styles = []
    for kind in classes().values():
        looks = kind.styles(split)
        styles.append(Style(next(iter(looks.shapes)), next(iter(looks.colours), ""), next(iter(kind.texts), ""), 3))
    return classes_sheet(tuple(classes()), styles, 15, Size(120, 96))


def tiled(shots: Sequence[Image.Image], labels: Sequence[str], columns: int) -> Image.Image:
    """Pictures of one size in a grid, each with its label below."""
    w, h = shots[0].size
    rows = math.ceil(len(shots) / columns)
    page = Image.new("RGB", (columns * (w + 4) + 4, rows * (h + 20) + 4), (250, 250, 248))
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(13)
    for i, (shot, label) in enumerate(zip(shots, labels, strict=True)):
        x, y = 4 + i % columns * (w + 4), 4 + i // columns * (h + 20)
        page.paste(shot, (x, y))
        pen.text((x + w / 2, y + h + 1), label, (30, 30, 30), font, "ma")
    return page
