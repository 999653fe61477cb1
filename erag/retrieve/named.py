"""Requests that name the thing they want ("Find a bench."), and what they call it."""

from __future__ import annotations

import re
from itertools import pairwise

from erag.core.text import singular, word_set, words
from erag.core.types import IntArray
from erag.retrieve.lexical import LexicalIndex, content
from erag.retrieve.scoring import Mask

_NAMES = re.compile(
    r"\W*(?:please )?(?:find|show|take|guide|bring|lead|is there|are there|(?:i am |i'm )?looking for"
    r"|(?:which|what) (?:spot|place)s? (?:has|have)|where (?:is|are|can i find|do i find) (?:the|a|an|some|any)\b)",
    re.IGNORECASE,
)
_BEFORE = word_set("me us to the a an some any nearest closest next my our")  # between the verb and the thing
_AFTER = word_set("""
    about above across along and around at away before behind below beneath beside between but by for from here in
    inside into last near next now of off on or out outside over please set that there to under up was were where which
    while who whose with within without is are
""")
_DETERMINERS = word_set("the a an some any this that these those his her its their")


def names_what_it_wants(text: str) -> bool:
    """Whether a request has the form of those that name a thing ("Find a bench."), rather than tell a wish."""
    return _NAMES.match(text) is not None


def named_thing(text: str) -> tuple[str, ...]:
    """The words, singular, by which such a request calls what it wants; none where it is of another form.

    They end before a preposition, a conjunction, or a participle with an object ("barriers closing a path").
    """
    asked = _NAMES.match(text)
    rest = words(text[asked.end() :]) if asked else []
    while rest and rest[0] in _BEFORE:
        rest = rest[1:]
    said: list[str] = []
    for word, following in pairwise([*rest, ""]):
        if word in _AFTER or (said and word.endswith("ing") and following in _DETERMINERS | _AFTER):
            break
        said.append(word)
    return tuple(map(singular, said)) if content(" ".join(said)) else ()


def bearers(index: LexicalIndex, text: str) -> IntArray:
    """The rows whose texts have the name by which a request calls what it wants; none where it gives no name."""
    return index.phrase_rows(named_thing(text))


def borne(index: LexicalIndex, text: str, eligible: Mask) -> bool:
    """Whether a node that is `eligible` (n,) has the name by which a request calls what it wants."""
    return bool(eligible[bearers(index, text)].any())
