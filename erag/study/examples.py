"""What a student learns from: an image and what is known to be in it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path

Box = tuple[float, float, float, float]  # left, top, right, bottom; y down, 0 to 1


@dataclass(frozen=True, slots=True)
class Instance:
    """One object in an image: the share of the image it covers (0 to 1), its box, look, and distance."""

    name: str
    share: float
    box: Box
    colour: str = ""
    shape: str = ""
    metres: float = 0.0


@dataclass(frozen=True, slots=True)
class Thing:
    """All instances of a class in an image, the largest first."""

    name: str
    instances: tuple[Instance, ...]

    @property
    def largest(self) -> Instance:
        return self.instances[0]

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the largest instance's box."""
        left, top, right, bottom = self.largest.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True)
class Example:
    """An image with its ground truth; `light` is what is said of light or weather ("" for nothing), `place` "" where
    the place is of no kind.

    `variant` 0 is the image as it is; others are seen through `augment`.
    """

    image: Path
    world: str
    place: str
    light: str
    caption: str
    instances: tuple[Instance, ...]
    variant: int = 0

    @cached_property
    def things(self) -> tuple[Thing, ...]:
        """The instances by class."""
        by_name: dict[str, list[Instance]] = defaultdict(list)
        for item in sorted(self.instances, key=lambda i: -i.share):
            by_name[item.name].append(item)
        return tuple(Thing(name, tuple(items)) for name, items in by_name.items())

    def seen(self, least: float) -> frozenset[str]:
        """The classes of which an instance covers at least the share `least` of the image."""
        return frozenset(thing.name for thing in self.things if thing.largest.share >= least)


@dataclass(frozen=True, slots=True)
class Words:
    """The words of a set of examples, sorted."""

    objects: tuple[str, ...]
    colours: tuple[str, ...]
    shapes: tuple[str, ...]
    places: tuple[str, ...]
    lights: tuple[str, ...]


def words_of(examples: Iterable[Example], least: float, fewest: int) -> Words:
    """Classes, colours and shapes that are seen in at least `fewest` images, and all places and lights.

    A place of no kind ("") is one of them: a student has to know when it does not know.
    """
    objects: Counter[str] = Counter()
    colours: Counter[str] = Counter()
    shapes: Counter[str] = Counter()
    places: set[str] = set()
    lights: set[str] = set()
    for example in examples:
        objects.update(example.seen(least))
        visible = [thing.largest for thing in example.things if thing.largest.share >= least]
        colours.update({item.colour for item in visible if item.colour})
        shapes.update({item.shape for item in visible if item.shape})
        places.add(example.place)
        lights.add(example.light)
    return Words(
        _frequent(objects, fewest), _frequent(colours, fewest), _frequent(shapes, fewest),
        tuple(sorted(places)), tuple(sorted(lights)),
    )  # fmt: skip


def _frequent(counts: Counter[str], fewest: int) -> tuple[str, ...]:
    return tuple(sorted(word for word, count in counts.items() if count >= fewest))


def divided(
    examples: Sequence[Example], studios: Sequence[Sequence[Example]], nth: int
) -> tuple[list[Example], list[Example]]:
    """What is learnt, and what only sets thresholds: every `nth` studio, since a student is surest where it has learnt.

    Without studios, runs of `nth` neighbours, every `nth` of them: neighbours on a path look alike.
    """
    runs = studios or [examples[i : i + nth] for i in range(0, len(examples), nth)]
    apart = list(chain(*runs[nth - 1 :: nth]))
    learnt = chain(*(run for number, run in enumerate(runs, 1) if number % nth))
    return [*(examples if studios else ()), *learnt], apart
