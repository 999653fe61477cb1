"""Frozen features of EfficientNet-Lite0 on one grid of cells: what the student learns from and looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from erag.lm.efficientnet import TAPS, EfficientNetLite0, batch
from erag.lm.images import Pixels, resized

if TYPE_CHECKING:
    import torch

WIDTH, HEIGHT = 384, 288  # pixels an image is resized to
COLUMNS, ROWS = WIDTH // 16, HEIGHT // 16  # cells of the grid
_COLOURS = 12  # mean red, green and blue of the quarters of a cell
FINE = TAPS[16][0] + 4 * TAPS[8][0] + _COLOURS  # channels at the resolution of the grid
COARSE = TAPS[32][0]  # channels at half the resolution
RULES = 1  # changes when other features come out of the same weights


@dataclass(frozen=True, slots=True)
class Maps:
    """Features of b images: `fine` (b, FINE, ROWS, COLUMNS) and `coarse` (b, COARSE, ROWS/2, COLUMNS/2)."""

    fine: torch.Tensor
    coarse: torch.Tensor


def shrunk(pixels: Pixels) -> Pixels:
    """(HEIGHT, WIDTH, 3) pixels; the proportions are given up, so that nothing is cut off."""
    return resized(pixels, WIDTH, HEIGHT)


def features(network: EfficientNetLite0, pictures: Sequence[Pixels]) -> Maps:
    """The features of `shrunk` pictures, float32. Each is computed on its own: its bits do not depend on the others."""
    import torch

    with torch.inference_mode():
        parts = [_one(network, picture) for picture in pictures]
        return Maps(torch.cat([p.fine for p in parts]), torch.cat([p.coarse for p in parts]))


def _one(network: EfficientNetLite0, picture: Pixels) -> Maps:
    import torch
    import torch.nn.functional as nnf

    image = batch([picture])  # (1, 3, HEIGHT, WIDTH)
    near, middle, far = network.maps(image, (8, 16, 32))
    colours = nnf.pixel_unshuffle(nnf.avg_pool2d(image, 8), 2)
    return Maps(torch.cat([middle, nnf.pixel_unshuffle(near, 2), colours], dim=1).contiguous(), far.contiguous())
