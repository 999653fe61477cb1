"""Procedural textures: (128, 128, 3) uint8 images that repeat without a seam, from two colours and a generator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

SIZE = 128
Image = npt.NDArray[np.floating[Any]]  # (SIZE, SIZE, 3) or (SIZE, SIZE), 0..1
Rgb = tuple[float, float, float]
Y, X = np.mgrid[0:SIZE, 0:SIZE]


def texture(kind: str, first: Rgb, second: Rgb, seed: int) -> npt.NDArray[np.uint8]:
    """The texture named `kind` in the colours `first` and `second` (0..1), the same for the same seed."""
    image = TEXTURES[kind](np.array(first), np.array(second), np.random.default_rng(seed))
    return np.asarray(np.clip(image * 255, 0, 255), np.uint8)


def _noise(rng: np.random.Generator, sigma: float | tuple[float, float]) -> Image:
    """Smooth noise of mean 0 and deviation 1 that repeats."""
    field = gaussian_filter(rng.standard_normal((SIZE, SIZE)), sigma, mode="wrap")
    return np.asarray((field - field.mean()) / field.std())


def _shade(colour: Image, amount: Image) -> Image:
    return np.asarray(colour * (1.0 + amount)[..., None])


def _mix(first: Image, second: Image, weight: Image) -> Image:
    return np.asarray(first * (1 - weight)[..., None] + second * weight[..., None])


def plain(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.03 * _noise(rng, 0.7))


def plaster(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.012 * _noise(rng, 6) + 0.012 * _noise(rng, 0.8))


def asphalt(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.14 * _noise(rng, 0.6) + 0.05 * _noise(rng, 9))


def gravel(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.2 * _noise(rng, 1.5)), b, (_noise(rng, 1.2) > 0.8) * 0.6)


def metal(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.04 * _noise(rng, (0.3, 14)))


def grain(a: Image, b: Image, rng: np.random.Generator) -> Image:
    rings = np.sin(X / 5.0 + 2.5 * _noise(rng, (26, 7)))
    return _mix(_shade(a, 0.05 * _noise(rng, (9, 0.5))), b, 0.22 * (rings + 1))


def planks(a: Image, b: Image, rng: np.random.Generator) -> Image:
    wood = grain(a, b, rng) * (1 + rng.uniform(-0.14, 0.14, 4))[(X // 32)][..., None]
    joint = (X % 32 < 2) | ((Y + 40 * (X // 32)) % SIZE < 2)
    return np.asarray(np.where(joint[..., None], wood * 0.45, wood))


def bricks(a: Image, b: Image, rng: np.random.Generator) -> Image:
    row = Y // 16
    column = (X + 16 * (row % 2)) // 32 % 4
    tone = rng.uniform(-0.2, 0.2, (8, 4))[row, column]
    joint = (Y % 16 < 3) | ((X + 16 * (row % 2)) % 32 < 3)
    return np.asarray(np.where(joint[..., None], b, _shade(a, tone + 0.06 * _noise(rng, 1))))


def tiles(a: Image, b: Image, rng: np.random.Generator) -> Image:
    tone = rng.uniform(-0.05, 0.05, (2, 2))[Y // 64, X // 64]
    joint = (Y % 64 < 2) | (X % 64 < 2)
    return np.asarray(np.where(joint[..., None], b, _shade(a, tone + 0.02 * _noise(rng, 2))))


def cobbles(a: Image, b: Image, rng: np.random.Generator) -> Image:
    row = Y // 16
    column = (X + 8 * (row % 2)) // 16 % 8
    u, v = (X + 8 * (row % 2)) % 16 - 7.5, Y % 16 - 7.5
    round_ = np.clip(1.25 - (u**2 + v**2) / 60, 0, 1)
    return _mix(b + 0 * Y[..., None], _shade(a, rng.uniform(-0.15, 0.15, (8, 8))[row, column]), round_)


def checks(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(a + 0 * Y[..., None], b, ((X // 64 + Y // 64) % 2).astype(float)) * (
        1 + 0.02 * _noise(rng, 1)[..., None]
    )


def stripes(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return np.asarray(np.where((X % 64 < 32)[..., None], a, b))


def bands(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return np.asarray(np.where((Y % 64 < 32)[..., None], a, b))


def slats(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, -0.35 * (Y % 16 < 4) + 0.03 * _noise(rng, 1))


def corrugated(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.16 * np.sin(X * 2 * np.pi / 16) + 0.02 * _noise(rng, 1))


def roof(a: Image, b: Image, rng: np.random.Generator) -> Image:
    row = Y // 16
    edge = (Y % 16 < 3) | ((X + 8 * (row % 2)) % 16 < 2)
    tone = rng.uniform(-0.12, 0.12, (8, 9))[row, (X + 8 * (row % 2)) // 16]
    return np.asarray(np.where(edge[..., None], a * 0.6, _shade(a, tone)))


def leaves(a: Image, b: Image, rng: np.random.Generator) -> Image:
    leaf = _noise(rng, 1.6)
    return _mix(_shade(a, 0.22 * leaf), b, np.clip(_noise(rng, 1.3) - 0.6, 0, 1))


def needles(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.3 * _noise(rng, (2.4, 0.5))), b, np.clip(_noise(rng, (2, 0.6)) - 0.7, 0, 1))


def flowers(a: Image, b: Image, rng: np.random.Generator) -> Image:
    image = leaves(np.array((0.16, 0.38, 0.12)), np.array((0.25, 0.5, 0.15)), rng)
    for x, y, which in zip(*rng.integers(0, SIZE, (2, 46)), rng.random(46), strict=True):
        u, v = (X - x + 64) % SIZE - 64, (Y - y + 64) % SIZE - 64
        distance = np.hypot(u, v)
        image[distance < 7.5] = a if which < 0.6 else b
        image[distance < 2.4] = (0.95, 0.85, 0.3)
    return image


def grass(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.18 * _noise(rng, (1.6, 0.5))), b, np.clip(0.5 * _noise(rng, 8), 0, 1))


def patchy(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(
        _shade(a, 0.2 * _noise(rng, (1.6, 0.5))), _shade(b, 0.08 * _noise(rng, 1)), (_noise(rng, 7) > 0.1) * 0.85
    )


def furrows(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.15 * _noise(rng, 1.2)), b, 0.5 + 0.5 * np.sin(X * 2 * np.pi / 64))


def straw(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.18 * _noise(rng, (0.5, 3))), b, np.clip(_noise(rng, (0.5, 4)) - 0.5, 0, 1))


def water(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(a + 0 * Y[..., None], b, np.clip(0.5 * _noise(rng, (2, 9)), 0, 0.8))


def carpet(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _mix(_shade(a, 0.1 * _noise(rng, 0.6)), b, (_noise(rng, 0.8) > 1.4) * 0.4)


def woven(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.1 * np.sign(np.sin(X * np.pi / 4) * np.sin(Y * np.pi / 4)) + 0.03 * _noise(rng, 1))


def rug(a: Image, b: Image, rng: np.random.Generator) -> Image:
    border = np.minimum.reduce([X, Y, SIZE - 1 - X, SIZE - 1 - Y])
    diamond = (np.abs(X - 64) + np.abs(Y - 64)) // 14 % 2 == 0
    figure = (border < 8) | ((border > 14) & diamond)
    return _mix(_shade(a, 0.06 * _noise(rng, 0.7)), b, 1.0 - figure)


def windows(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """A wall of bricks with one window in the middle; `b` is the frame."""
    image = bricks(a, a * 0.8 + 0.12, rng)
    return _window(image, b, 36, 92, 30, 100)


def panes(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """A rendered wall with one wide window; `b` is the frame."""
    return _window(plaster(a, b, rng), b, 20, 108, 40, 100)


def glazing(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """A curtain wall of glass."""
    sky = 0.75 + 0.25 * (SIZE - Y) / SIZE + 0.05 * _noise(rng, (16, 3))
    frame = (X % 64 < 4) | (Y % 64 < 4)
    return np.asarray(np.where(frame[..., None], b, _shade(a, sky - 1)))


def _window(image: Image, frame: Image, x0: int, x1: int, y0: int, y1: int) -> Image:
    inside = (x0 <= X) & (x1 > X) & (y0 <= Y) & (y1 > Y)
    bar = ~((x0 + 4 <= X) & (x1 - 4 > X) & (y0 + 4 <= Y) & (y1 - 4 > Y))
    bar |= (np.abs(X - (x0 + x1) / 2) < 2) | (np.abs(Y - (y0 + y1) / 2) < 2)
    glass = np.array((0.30, 0.42, 0.52)) * (1.25 - 0.006 * ((X - Y) % 60))[..., None]
    return np.asarray(np.where(inside[..., None], np.where(bar[..., None], frame, glass), image))


def goods(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Two shelf boards full of packets, tins and bottles."""
    image = np.full((SIZE, SIZE, 3), 0.16)
    for top in (0, 64):
        x = 1
        while x < SIZE - 6:
            width, height = int(rng.integers(7, 17)), int(rng.integers(30, 52))
            colour = rng.choice(_GOODS)
            image[top + 56 - height : top + 56, x : min(x + width, SIZE)] = colour
            image[top + 56 - height // 2 : top + 60 - height // 3, x + 1 : min(x + width - 1, SIZE)] = 1 - colour * 0.4
            x += width + 1
        image[top + 56 : top + 64] = a
        image[top + 58 : top + 62, :: int(rng.integers(20, 30))] = (0.95, 0.9, 0.3)
    return image


_GOODS = np.array(
    [(0.85, 0.15, 0.12), (0.95, 0.75, 0.1), (0.15, 0.35, 0.75), (0.2, 0.6, 0.25), (0.9, 0.9, 0.88), (0.9, 0.45, 0.1),
     (0.5, 0.2, 0.55), (0.45, 0.25, 0.12), (0.95, 0.6, 0.7), (0.1, 0.55, 0.6)]
)  # fmt: skip


def books(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Two boards full of books."""
    image = np.full((SIZE, SIZE, 3), 0.09)
    for top in (0, 64):
        x = 0
        while x < SIZE:
            width, height = int(rng.integers(4, 11)), int(rng.integers(40, 54))
            colour = rng.choice(_GOODS) * rng.uniform(0.45, 0.9)
            image[top + 57 - height : top + 57, x : x + width - 1] = colour
            image[top + 62 - height : top + 65 - height, x : x + width - 1] = (0.85, 0.75, 0.45)
            x += width
        image[top + 57 : top + 64] = a
    return image


def fruit(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Round fruit side by side, some in `b`."""
    u, v = X % 16 - 7.5, Y % 16 - 7.5
    which = rng.random((8, 8))[Y // 16, X // 16] < 0.3
    light = np.clip(1.25 - ((u + 2) ** 2 + (v + 2) ** 2) / 70, 0.25, 1.2)
    return np.asarray(np.where(which[..., None], b, a) * light[..., None])


def hide(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Large patches, as on cattle."""
    return _mix(a + 0 * Y[..., None], b, (_noise(rng, 13) > 0.35).astype(float))


def wool(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.13 * _noise(rng, 2.2))


def bark(a: Image, b: Image, rng: np.random.Generator) -> Image:
    return _shade(a, 0.28 * _noise(rng, (8, 1.4)))


def mesh(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Wires on a dark ground, as of a net or a fence."""
    wire = ((X + Y) % 32 < 5) | ((X - Y) % 32 < 5)
    return np.asarray(np.where(wire[..., None], a, b))


def cage(a: Image, b: Image, rng: np.random.Generator) -> Image:
    """Upright wires on a dark ground, as of a trolley."""
    return np.asarray(np.where(((X % 16 < 4) | (Y % 64 < 6))[..., None], a, b))


TEXTURES: Mapping[str, Callable[[Image, Image, np.random.Generator], Image]] = {
    f.__name__: f
    for f in (
        plain, plaster, asphalt, gravel, metal, grain, planks, bricks, tiles, cobbles, checks, stripes, bands, slats,
        corrugated, roof, leaves, needles, flowers, grass, patchy, furrows, straw, water, carpet, woven, rug, windows,
        panes, glazing, goods, books, fruit, hide, wool, bark, mesh, cage,
    )
}  # fmt: skip
