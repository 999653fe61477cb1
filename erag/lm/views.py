"""Parts of an image that a whole-image network is shown one by one, so that it also says where things are."""

from __future__ import annotations

from erag.lm.images import Pixels
from erag.lm.wording import Side

# (left, top, right, bottom) as shares of the image, and the side of the view it stands for
VIEWS: tuple[tuple[tuple[float, float, float, float], Side], ...] = (
    ((0.0, 0.0, 1.0, 1.0), "around"),
    ((0.0, 0.1, 0.6, 0.9), "left"),
    ((0.2, 0.1, 0.8, 0.9), "middle"),
    ((0.4, 0.1, 1.0, 0.9), "right"),
)


def views(pixels: Pixels) -> list[Pixels]:
    """The whole (h, w, 3) image, its left, its middle and its right."""
    return [_cut(pixels, box) for box, _ in VIEWS]


def _cut(pixels: Pixels, box: tuple[float, float, float, float]) -> Pixels:
    height, width, _ = pixels.shape
    left, top, right, bottom = box
    rows = slice(int(top * height), max(int(bottom * height), int(top * height) + 1))
    return pixels[rows, int(left * width) : max(int(right * width), int(left * width) + 1)]
