"""English for what is seen: noun phrases with number, colour and shape, lists, and readable phrase tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TypeVar

import numpy as np

from erag.sim.truth import Seen
from erag.sim.vocabulary import article, plural, read_words

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
READABLE = 0.02  # share of the image from which on a caption quotes what is written on an object
_SPOKEN = frozenset(
    {"bus", "shop", "van", "kiosk", "office tower", "billboard", "direction sign", "lorry", "menu board"}
)
_SIZES = frozenset({"long", "tall", "round", "square", "low", "flat", "high-backed", "three-armed", "domed"})
T = TypeVar("T")


@cache
def phrases() -> Mapping[str, Mapping[str, Sequence[str]]]:
    """The phrase tables of `words/phrases.yaml`: sentence patterns and words by season, light and weather."""
    return read_words("phrases")


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """One of the options."""
    return options[int(rng.integers(len(options)))]


def number(n: int) -> str:
    """A whole number as a word, up to twelve."""
    return NUMBERS[n] if n < len(NUMBERS) else str(n)


def listed(items: Sequence[str]) -> str:
    """Items as an English list."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def capital(text: str) -> str:
    """The text with its first letter in capitals."""
    return text[:1].upper() + text[1:]


def look(thing: Seen) -> str:
    """Colour, shape and class, without an article: `red wooden bench`, `person in blue`."""
    if thing.name == "person":
        return f"person in {thing.colour}"
    order = (thing.shape, thing.colour) if thing.shape in _SIZES else (thing.colour, thing.shape)
    words = [w for w in order if w and w not in thing.name]
    return " ".join([*dict.fromkeys(words), thing.name])


def described(thing: Seen, *, quote: bool = True) -> str:
    """One object with its article, and what is written on it if it is large enough to be read."""
    text = article(look(thing))
    if quote and thing.text and thing.name in _SPOKEN and thing.share >= READABLE:
        return f'{text} that reads "{thing.text}"'
    return text


def grouped(things: Sequence[Seen]) -> str:
    """Objects of one class: one described, several counted, with their colours where these are few."""
    if len(things) == 1:
        return described(things[0])
    name = things[0].name
    colours = [t.colour for t in things if t.colour]
    if name == "person":
        return f"{number(len(things))} people"
    if len(set(colours)) == 1 and len(colours) == len(things):
        return f"{number(len(things))} {colours[0]} {plural(name)}"
    if len(things) <= 3 and len(set(colours)) == len(things):
        return f"{number(len(things))} {plural(name)} ({listed(colours)})"
    return f"{number(len(things))} {plural(name)}"
