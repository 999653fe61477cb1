"""The things that texts name, under one name each: how often, how many, and on which side of the view."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from erag.core.text import sentences, word_set, words
from erag.core.types import TopoMap
from erag.forest import lexicon as lex
from erag.forest.terms import Phrase, fold, mentions, name_mentions, stem

Name = tuple[str, ...]  # folded words, head last
Side = Literal["left", "centre", "right"]

# Heads that are no things one could count or miss: what the ground, the sky and the hour are like, and where.
SURROUNDINGS = word_set("""
    ground floor grass snow sky cloud leaf tile parquet carpet shadow sunlight light wall ceiling morning noon evening
    night day dusk dawn midday afternoon mist fog rain sun shade meadow soil earth sand mud dirt gravel asphalt concrete
    pavement paving cobblestone water air weather season nothing little lot middle left right centre center side
    distance background foreground part top bottom front back way end corner edge lawn vegetation greenery foliage
    number group row pair robot view something everything anything chip lamplight ice straight well away lit quarter
    southern northern eastern western spiky leafy bushy shiny dusty rusty sunny cloudy misty foggy rainy bright
""")
_SHAPES = word_set("round square flat upright long tall low oval double single open closed empty full further")
_ADJECTIVE_SHARE = 0.8  # an adjective-like word that nearly always goes with a head belongs to its name: potted plant
_NUMBERS: Mapping[str, int] = {
    "two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8, "nine": 9, "ten": 10, "eleven": 11,
    "twelve": 12, "several": 3, "many": 4,
}  # fmt: skip
_NUMBER = re.compile(rf"\b(\d{{1,2}}|{'|'.join(_NUMBERS)})((?:\s+[^\W\d_]+(?:-[^\W\d_]+)*){{1,4}})")
_SIDE = re.compile(
    r"\b(?:(?:on|to|at) (?:the|its|your) (left|right)|further (left|right)|in the (middle|centre|center)|"
    r"(straight) ahead)\b"
)


@dataclass(frozen=True, slots=True)
class Mention:
    """A thing named in the text of node `row`: at least `count` of it, on a `side` of the view where that is said."""

    name: Name
    row: int
    count: int = 1
    side: Side | None = None


@dataclass(frozen=True, slots=True)
class _Said:
    """A phrase of a text, how many it says there are, and on which side."""

    words: Name
    plural: str
    count: int
    side: Side | None


class Things:
    """All mentions of things in the `texts` (n) of a map's nodes."""

    def __init__(self, topomap: TopoMap, texts: Sequence[str]) -> None:
        self._map, self._texts = topomap, texts

    @cached_property
    def mentions(self) -> tuple[Mention, ...]:
        """Every mention, in the order of the nodes; a thing is mentioned once a node."""
        found: dict[tuple[Name, int], Mention] = {}
        for row, said in enumerate(self._said):
            for phrase in said:
                name = self._name(phrase.words)
                if name and (known := found.get((name, row))) is None:
                    found[name, row] = Mention(name, row, phrase.count, phrase.side)
                elif name and known is not None:
                    found[name, row] = Mention(name, row, max(known.count, phrase.count), known.side or phrase.side)
        return tuple(found.values())

    @cached_property
    def by_name(self) -> Mapping[Name, tuple[Mention, ...]]:
        """The mentions of each name."""
        found: dict[Name, list[Mention]] = {}
        for mention in self.mentions:
            found.setdefault(mention.name, []).append(mention)
        return {name: tuple(listed) for name, listed in sorted(found.items())}

    def of(self, asked: Name) -> tuple[Mention, ...]:
        """The mentions of a thing asked for: those whose phrase has all its words and its head, one a node.

        Where none has, those of its head alone, then the nodes whose texts have the words next to each other, which
        finds what looks like a verb. `bicycle` is in `red bicycle`, and `bicycle stand` is another thing.
        """
        for wanted in dict.fromkeys((asked, asked[-1:])):
            found = [
                Mention(wanted, row, max(p.count for p in fitting), next((p.side for p in fitting if p.side), None))
                for row, said in enumerate(self._said)
                if (fitting := [p for p in said if fits(wanted, p.words)])
            ]
            if found:
                return tuple(found)
        near = (row for row, said in enumerate(self._folded) if _in_order(asked, said))
        return tuple(Mention(asked, r) for r in near if stem(asked[-1]) not in mentions(self._texts[r]).denied_words)

    def shown(self, name: Name, many: bool = False) -> str:
        """How a name is said: `coffee table`, or its plural as the texts have it."""
        if not many:
            return " ".join(name)
        forms = self._plurals.get(name[-1])
        return " ".join((*name[:-1], forms.most_common(1)[0][0] if forms else _plural(name[-1])))

    @cached_property
    def _said(self) -> tuple[tuple[_Said, ...], ...]:
        """What each node's text names, (n)."""
        named = [not (node.caption or "").strip() for node in self._map.nodes]
        return tuple(
            _of_name(text) if is_name else tuple(_phrases(text))
            for text, is_name in zip(self._texts, named, strict=True)
        )

    @cached_property
    def _folded(self) -> tuple[Name, ...]:
        """The folded words of each text, (n)."""
        return tuple(tuple(fold(w) for w in words(text)) for text in self._texts)

    @cached_property
    def _plurals(self) -> Mapping[str, Counter[str]]:
        forms: dict[str, Counter[str]] = {}
        for phrase in (p for said in self._said for p in said if p.plural):
            forms.setdefault(phrase.words[-1], Counter())[phrase.plural] += 1
        return forms

    @cached_property
    def _endings(self) -> Counter[Name]:
        """How many phrases end in these words."""
        return Counter(p.words[i:] for said in self._said for p in said for i in range(len(p.words)))

    def _name(self, spoken: Name) -> Name:
        """The name of the thing in a phrase, without what merely describes it; empty for what is no thing."""
        head = spoken[-1]
        if (
            head in SURROUNDINGS
            or head in lex.PLACES
            or head in lex.SEASONS
            or head in lex.WEATHER
            or head in lex.LIGHT
        ):
            return ()
        if head in lex.ATTRIBUTES or len(head) < 3:
            return ()
        name = spoken
        while len(name) > 1 and self._describes(name):
            name = name[1:]
        return name[-3:]

    def _describes(self, name: Name) -> bool:
        first = name[0]
        if first in lex.ATTRIBUTES or first in _SHAPES or first in lex.PLACES - {"parking-lot"}:
            return first not in lex.PLACES or self._endings[name] < _ADJECTIVE_SHARE * self._endings[name[1:]]
        usual = self._endings[name] >= _ADJECTIVE_SHARE * self._endings[name[1:]]
        return first.endswith(lex.ADJECTIVE_ENDINGS) and not usual


def _plural(word: str) -> str:
    if word.endswith(("s", "x", "z", "ch", "sh")):
        return f"{word}es"
    return f"{word[:-1]}ies" if word.endswith("y") and word[-2:-1] not in "aeiou" else f"{word}s"


def fits(asked: Name, spoken: Name) -> bool:
    """Whether a phrase names what is asked for: the same head, and all the words."""
    return bool(spoken) and spoken[-1] == asked[-1] and set(asked) <= set(spoken)


def _in_order(asked: Name, said: Name) -> bool:
    return any(said[i : i + len(asked)] == asked for i, w in enumerate(said) if w == asked[0])


def alike(one: Name, other: Name) -> bool:
    """Whether two names may well be one thing: the same head, and one of them says no more than the other."""
    return one[-1] == other[-1] and (set(one) <= set(other) or set(other) <= set(one))


def _of_name(text: str) -> tuple[_Said, ...]:
    """The whole name of an object is the thing."""
    phrases = name_mentions(text).phrases
    return (_Said(phrases[0].words, phrases[0].plural, 1, None),) if phrases else ()


def _phrases(text: str) -> Iterator[_Said]:
    for sentence in sentences(text):
        numbers = _numbers(sentence)
        for clause, side in _clauses(sentence):
            for phrase in mentions(clause).phrases:
                yield _Said(phrase.words, phrase.plural, _count(phrase, numbers), side)


def _clauses(sentence: str) -> Iterator[tuple[str, Side | None]]:
    """The parts of a sentence between commas, with the side each is said to be on."""
    before: Side | None = None
    for clause in sentence.split(", "):
        match = _SIDE.search(clause.lower())
        side: Side | None = None
        if match:
            plain, further = match[1], match[2]
            if further:
                side = "right" if further == "right" and before != "left" else None
                side = "left" if further == "left" and before != "right" else side
            else:
                side = "left" if plain == "left" else "right" if plain == "right" else "centre"
        before = side or before
        yield clause, side


def _numbers(sentence: str) -> dict[str, int]:
    """Numbers that a sentence states, by the folded words up to four places behind them, the first one each."""
    found: dict[str, int] = {}
    for match in _NUMBER.finditer(sentence.lower()):
        count = int(match[1]) if match[1].isdigit() else _NUMBERS[match[1]]
        for word in match[2].split():
            if word in ("and", "with", "beside", "next", "of", "in", "on", "near"):
                break
            found.setdefault(fold(word), count)
    return found


def _count(phrase: Phrase, numbers: Mapping[str, int]) -> int:
    if not phrase.plural:
        return 1
    return max(numbers.get(phrase.words[-1], 2), 1)
