"""A captioner's views against the ground truth: objects, places, positions, attributes, and images found by text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erag.evaluate.naming import Naming, counted, micro, naming, universe
from erag.evaluate.statistics import Interval
from erag.lm.roles import Vectors
from erag.lm.student import Found, View
from erag.lm.student_words import StudentWords
from erag.study.examples import Example, Thing


@dataclass(frozen=True)
class Judged:
    """Figures of a captioner on some worlds.

    `offset` is the median distance between said and true centre as a share of the image's width and height,
    `colours` the share of rightly found objects whose colour is true where one was said, `said` how often it was;
    `search` the shares of captions whose image is first, or among the first five, when all images are searched by the
    caption's vector; `learnt` the share of images whose place is of a kind it has learnt, and of those the share whose
    place it names rightly. None where the captioner says nothing of the kind.
    """

    quality: Naming
    worlds: Mapping[str, Interval]
    offset: float | None = None
    colours: float | None = None
    said: float | None = None
    search: tuple[float, float] | None = None
    learnt: tuple[float, float] | None = None


def judge_views(
    views: Sequence[View], examples: Sequence[Example], words: StudentWords, least: float, resamples: int,
    search: tuple[float, float] | None = None,
) -> Judged:  # fmt: skip
    """The figures of the views of a student that knows `words`; the classes of the truth count beside its own."""
    said = [frozenset(found.name for found in view.objects) for view in views]
    base = judge_words(said, [view.place for view in views], examples, words.objects, least, resamples)
    known = [v.place == e.place for v, e in zip(views, examples, strict=True) if e.place in words.places]
    pairs = _pairs(views, examples, least)
    offsets = [np.hypot(f.x - t.centre[0], f.y - t.centre[1]) for f, t in pairs]
    coloured = [(f.colour, t.largest.colour) for f, t in pairs if t.largest.colour]
    spoken = [said == true for said, true in coloured if said]
    return Judged(
        base.quality,
        base.worlds,
        offset=float(np.median(offsets)) if offsets else None,
        colours=float(np.mean(spoken)) if spoken else None,
        said=len(spoken) / max(1, len(coloured)),
        search=search,
        learnt=(len(known) / len(examples), float(np.mean(known)) if known else 0.0),
    )


def judge_words(
    said: Sequence[frozenset[str]], places: Sequence[str], examples: Sequence[Example], names: Sequence[str],
    least: float, resamples: int,
) -> Judged:  # fmt: skip
    """The figures of object words and place words; words that are neither in `names` nor in the truth do not count."""
    truth = [example.seen(least) for example in examples]
    classes = universe(names, truth)
    counts = counted(said, truth, classes)
    right = [place == example.place for place, example in zip(places, examples, strict=True)]
    overall = naming(counts, right, classes, resamples)
    worlds: dict[str, Interval] = {}
    for world in dict.fromkeys(example.world for example in examples):
        rows = [i for i, example in enumerate(examples) if example.world == world]
        worlds[world] = micro(counts[rows].sum(axis=1), resamples)[2]
    return Judged(overall, worlds)


def _pairs(views: Sequence[View], examples: Sequence[Example], least: float) -> list[tuple[Found, Thing]]:
    """Each object that was found beside what it is in truth."""
    pairs = []
    for view, example in zip(views, examples, strict=True):
        things = {thing.name: thing for thing in example.things if thing.largest.share >= least}
        pairs += [(found, things[found.name]) for found in view.objects if found.name in things]
    return pairs


def searched(images: Vectors, texts: Vectors) -> tuple[float, float]:
    """The shares of texts (n, d) whose image (n, d) is first, and among the first five; equal texts share images."""
    scores = texts @ images.T
    same = texts @ texts.T > 0.999
    best = np.where(same, scores, -np.inf).max(axis=1)
    rank = (scores > best[:, None]).sum(axis=1)
    return float((rank < 1).mean()), float((rank < 5).mean())
