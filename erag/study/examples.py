"""What a student learns from: an image and what is known to be in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """All instances of a class in an image: their share of it (0 to 1), how many, and where the largest is.

    `x` right and `y` down, 0 to 1; `metres` from the camera; `cells` (r, k) is how much of each cell of a grid the
    class covers, None where that is not known.
    """

    name: str
    share: float
    x: float
    y: float
    number: int = 1
    colour: str = ""
    shape: str = ""
    metres: float = 0.0
    cells: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """An image with its ground truth; `light` is what is said of light or weather ("" for nothing)."""

    image: Path
    world: str
    place: str
    light: str
    caption: str
    things: tuple[Thing, ...]

    def seen(self, least: float) -> frozenset[str]:
        """The classes that cover at least the share `least` of the image."""
        return frozenset(thing.name for thing in self.things if thing.share >= least)


@dataclass(frozen=True, slots=True)
class Words:
    """The words of a set of examples, sorted."""

    objects: tuple[str, ...]
    colours: tuple[str, ...]
    shapes: tuple[str, ...]
    places: tuple[str, ...]
    lights: tuple[str, ...]


def words_of(examples: Iterable[Example], least: float, fewest: int) -> Words:
    """Classes, colours and shapes that are seen in at least `fewest` images, and all places and lights."""
    objects: Counter[str] = Counter()
    colours: Counter[str] = Counter()
    shapes: Counter[str] = Counter()
    places: set[str] = set()
    lights: set[str] = set()
    for example in examples:
        objects.update(example.seen(least))
        colours.update({thing.colour for thing in example.things if thing.share >= least and thing.colour})
        shapes.update({thing.shape for thing in example.things if thing.share >= least and thing.shape})
        places.add(example.place)
        lights.add(example.light)
    return Words(
        _frequent(objects, fewest), _frequent(colours, fewest), _frequent(shapes, fewest),
        tuple(sorted(places)), tuple(sorted(lights)),
    )  # fmt: skip


def _frequent(counts: Counter[str], fewest: int) -> tuple[str, ...]:
    return tuple(sorted(word for word, count in counts.items() if count >= fewest))


def every(examples: Sequence[T], nth: int) -> tuple[list[T], list[T]]:
    """Split for calibration: every `nth` example apart from the others; neighbours on a path look alike, so in runs.

    Runs of `nth` neighbours: the last run of every `nth` goes to the second list.
    """
    first: list[T] = []
    second: list[T] = []
    for i, example in enumerate(examples):
        (second if (i // nth) % nth == nth - 1 else first).append(example)
    return first, second
