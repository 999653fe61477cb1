"""What a captioner without a language model says: things seen, where in the view, place and light, as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from erag.lm.roles import Caption

Side = Literal["left", "middle", "right", "around"]
_LEAD: dict[Side, str] = {
    "left": "on the left", "middle": "in the middle", "right": "on the right", "around": "in view",
}  # fmt: skip
_VOWELS = "aeiou"
_AN = ("hour", "honest", "heir")
_A = ("uni", "use", "eu", "one", "ut")
_PLURALS = {
    "person": "people", "shelf": "shelves", "bookshelf": "bookshelves", "leaf": "leaves", "man": "men",
    "sheep": "sheep", "fish": "fish", "child": "children", "knife": "knives", "loaf": "loaves", "goose": "geese",
}  # fmt: skip
_NO_ARTICLE = frozenset({
    "grass", "hay", "water", "gravel", "sand", "snow", "maize", "cereal", "jeans", "sunglasses", "binoculars", "scales",
    "ivy", "soil", "people", "stairs", "steps", "shelves", "rocks", "laundry", "bananas", "wheat", "corn", "barley",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sighting:
    """A kind of thing seen: its `word`, the side of the view it is on, words on it, and whether it is far or many.

    `area` is its share of the image (0 to 1) and decides what is said first.
    """

    word: str
    side: Side = "around"
    attributes: tuple[str, ...] = ()
    area: float = 0.0
    many: bool = False
    far: bool = False


def third(x: float) -> Side:
    """The side of the view of a horizontal position (0 left to 1 right)."""
    return "left" if x < 0.36 else "right" if x > 0.64 else "middle"


def article(phrase: str) -> str:
    """`phrase` with "a" or "an"; as it is for words that take neither and for plurals of the usual form."""
    last = phrase.rsplit(" ", 1)[-1]
    if last in _NO_ARTICLE or (last.endswith("s") and not last.endswith(("ss", "us", "is"))):
        return phrase
    first = phrase.lower()
    vowel = first.startswith(_AN) or (first[:1] in _VOWELS and not first.startswith(_A))
    return f"{'an' if vowel else 'a'} {phrase}"


def plural(noun: str) -> str:
    """The plural of a noun phrase, whose last word is the noun."""
    head, _, last = noun.rpartition(" ")
    if last in _NO_ARTICLE:
        return noun
    if last in _PLURALS:
        many = _PLURALS[last]
    elif last.endswith(("s", "x", "ch", "sh")):
        many = f"{last}es"
    elif last.endswith("y") and last[-2:-1] not in _VOWELS:
        many = f"{last[:-1]}ies"
    else:
        many = f"{last}s"
    return f"{head} {many}".strip()


def phrase(sighting: Sighting) -> str:
    """A sighting as a noun phrase: "a red bench", "several trees", "a church in the distance"."""
    words = " ".join([*sighting.attributes, sighting.word])
    said = f"several {plural(words)}" if sighting.many else article(words)
    return f"{said} in the distance" if sighting.far else said


def listed(parts: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def describe(opening: str, sightings: Sequence[Sighting], closing: str = "") -> Caption:
    """A caption: the opening sentence, a sentence for each side of the view (largest things first), and the closing.

    The objects are the words of the sightings, largest first.
    """
    order = sorted(sightings, key=lambda s: (-s.area, s.word))
    sides: list[Side] = list(dict.fromkeys(s.side for s in order))
    sentences = [opening] if opening else []
    for side in sides:
        here = [s for s in order if s.side == side]
        verb = "are" if len(here) > 1 or here[0].many else "is"
        sentences.append(f"{_LEAD[side]} {verb} {listed([phrase(s) for s in here])}.")
    text = " ".join(_capital(s) for s in [*sentences, closing] if s)
    return Caption(text, tuple(dict.fromkeys(s.word for s in order)))


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
