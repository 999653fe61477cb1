"""Images seen otherwise: a part of them, other hues, other light; with the truth that goes with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from erag.core.text import content_hash
from erag.lm.images import Pixels, resized
from erag.study.examples import Box, Example, Instance

_SMALLEST = 0.7  # of width and height that a part shows
_LUMA = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, slots=True)
class Look:
    """How a variant is made: the part shown, the turn of hues (radians), factors of saturation and contrast, gamma."""

    box: Box
    turn: float
    saturation: float
    contrast: float
    gamma: float


def look(example: Example) -> Look | None:
    """The look of an example's variant, always the same one; None for the image as it is."""
    if example.variant == 0:
        return None
    seed = content_hash(example.image.name, example.world, str(example.variant))
    rng = np.random.default_rng(int.from_bytes(seed[:8], "little"))
    side = rng.uniform(_SMALLEST, 1.0)
    left, top = rng.uniform(0, 1 - side, 2)
    return Look(
        (left, top, left + side, top + side),
        turn=rng.uniform(-np.pi, np.pi), saturation=rng.uniform(0.2, 1.4), contrast=rng.uniform(0.7, 1.3),
        gamma=rng.uniform(0.6, 1.6),
    )  # fmt: skip


def seen_through(pixels: Pixels, how: Look | None) -> Pixels:
    """(h, w, 3) pixels with a look, at the same size."""
    if how is None:
        return pixels
    height, width, _ = pixels.shape
    left, top, right, bottom = how.box
    part = pixels[int(top * height) : int(bottom * height), int(left * width) : int(right * width)]
    values = resized(part, width, height).astype(np.float64) / 255
    values = _turned(values, how.turn, how.saturation)
    values = np.clip((values - 0.5) * how.contrast + 0.5, 0, 1) ** how.gamma
    return np.round(values * 255).astype(np.uint8)


def varied(example: Example) -> Example:
    """An example with the truth of its variant: what is outside the part shown is gone, colours are not known."""
    how = look(example)
    if how is None:
        return example
    inside = [_moved(item, how.box) for item in example.instances]
    return replace(example, instances=tuple(item for item in inside if item is not None))


def _moved(item: Instance, part: Box) -> Instance | None:
    left, top, right, bottom = item.box
    width, height = part[2] - part[0], part[3] - part[1]
    x0, x1 = (min(max((x - part[0]) / width, 0.0), 1.0) for x in (left, right))
    y0, y1 = (min(max((y - part[1]) / height, 0.0), 1.0) for y in (top, bottom))
    area = (x1 - x0) * (y1 - y0)
    if area <= 0:
        return None
    fill = item.share / max((right - left) * (bottom - top), 1e-9)
    return replace(item, box=(x0, y0, x1, y1), share=min(1.0, fill * area), colour="")


def _turned(values: npt.NDArray[np.float64], turn: float, saturation: float) -> npt.NDArray[np.float64]:
    """Hues turned about the grey axis and saturation scaled, brightness kept."""
    grey = (values @ _LUMA)[..., None]
    axis = np.full(3, 3**-0.5)
    colour = values - grey
    cross = np.cross(np.broadcast_to(axis, colour.shape), colour)
    along = (colour @ axis)[..., None] * axis * (1 - np.cos(turn))
    rotated: npt.NDArray[np.float64] = grey + saturation * (colour * np.cos(turn) + cross * np.sin(turn) + along)
    return np.clip(rotated, 0, 1)
