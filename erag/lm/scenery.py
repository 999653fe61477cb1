"""Colour, light and layout of an image from its pixels alone: no weights, no guess at what things are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.lm.images import Pixels, resized

Values = npt.NDArray[np.float64]  # (64, 64) or (64, 64, 3), 0 to 1
_SIZE = 64  # pixels a side that are looked at
_GREY = 0.16  # saturation below which a pixel has no hue
_HUES = (
    (15, "red"), (40, "orange"), (70, "yellow"), (165, "green"), (200, "turquoise"), (260, "blue"), (330, "purple"),
    (360, "red"),
)  # fmt: skip  # each up to so many degrees
_SHARE = 0.18  # of the pixels, from which on a colour is named


@dataclass(frozen=True, slots=True)
class Scenery:
    """Words on an image: its light, its commonest colours, and its layout ("" where nothing stands out)."""

    light: str
    colours: tuple[str, ...]
    layout: str

    def sentence(self) -> str:
        """The words as a sentence."""
        colours = f", mostly {' and '.join(self.colours)}" if self.colours else ""
        layout = f"; {self.layout}" if self.layout else ""
        return f"The view is {self.light}{colours}{layout}."


def scenery(pixels: Pixels) -> Scenery:
    """Light, colours and layout of (h, w, 3) pixels."""
    small = resized(pixels, _SIZE, _SIZE).astype(np.float64) / 255
    names = _colour_names(small)  # (64, 64)
    value = small.max(axis=2)
    return Scenery(_light(small, value), _commonest(names), _layout(small, names, value))


def _colour_names(small: Values) -> npt.NDArray[np.str_]:
    """The name of each pixel's colour, by hue where it is saturated, else by brightness."""
    high, low = small.max(axis=2), small.min(axis=2)
    chroma = high - low
    saturation = chroma / np.maximum(high, 1e-9)
    hue = _hue(small, high, chroma)
    coloured = np.array([name for _, name in _HUES])[np.searchsorted([h for h, _ in _HUES], hue, side="right")]
    coloured = np.where((coloured == "orange") & (high < 0.6), "brown", coloured)
    plain = np.select([high < 0.2, high < 0.8], ["black", "grey"], "white")
    plain = np.where((saturation > 0.08) & (high > 0.6) & np.isin(coloured, ("orange", "yellow")), "beige", plain)
    return np.where((saturation < _GREY) | (high < 0.2), plain, coloured)


def _hue(small: Values, high: Values, chroma: Values) -> Values:
    """Degrees in [0, 360); 0 where there is none."""
    red, green, blue = np.moveaxis(small, 2, 0)
    width = np.maximum(chroma, 1e-9)
    sectors = [((green - blue) / width) % 6, (blue - red) / width + 2, (red - green) / width + 4]
    hue: Values = np.select([high == red, high == green], sectors[:2], sectors[2]) * 60.0 % 360.0
    return hue


def _light(small: Values, value: Values) -> str:
    mean = float(value.mean())
    if mean < 0.22:
        return "dark"
    warm = float((small[:, :, 0] - small[:, :, 2]).mean())
    tone = "warmly lit" if warm > 0.12 else "bright" if mean > 0.6 else "evenly lit"
    return f"dim, {tone}" if mean < 0.4 and tone != "bright" else tone


def _commonest(names: npt.NDArray[np.str_]) -> tuple[str, ...]:
    found, counts = np.unique(names, return_counts=True)
    order = sorted(zip(counts.tolist(), found.tolist(), strict=True), key=lambda pair: (-pair[0], pair[1]))
    return tuple(name for count, name in order[:2] if count / names.size >= _SHARE)


def _layout(small: Values, names: npt.NDArray[np.str_], value: Values) -> str:
    """Sky above, vegetation below, or neither: told from the colours of the upper and lower thirds."""
    third = _SIZE // 3
    top, bottom = names[:third], names[-third:]
    smooth = float(np.abs(np.diff(small[:third].mean(axis=2), axis=1)).mean()) < 0.02
    blue = float(np.isin(top, ("blue", "turquoise")).mean())
    pale = float((np.isin(top, ("white",)) & (value[:third] > 0.85)).mean())
    parts = []
    if smooth and (blue > 0.5 or pale > 0.7):
        parts.append("smooth blue above" if blue > 0.5 else "pale above")
    ground, share = np.unique(bottom, return_counts=True)
    main = str(ground[share.argmax()])
    if share.max() / bottom.size > 0.6:
        parts.append(f"{main} below")
    return ", ".join(parts)
