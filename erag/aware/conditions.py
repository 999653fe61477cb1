"""Season, weather and hour as the texts of a visit tell them, and how two visits differ in these."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from erag.core.text import words
from erag.core.types import IntArray
from erag.forest import lexicon as lex
from erag.forest.terms import fold

LEAST = 0.15  # share of a visit's views from which on a word characterises it
DIFFERENT = 0.15  # and by how much its share has to differ from that of the other visit
_HOURS = ("morning", "noon", "midday", "afternoon", "evening", "night", "dusk", "dawn")
_WORDS = (
    frozenset(lex.SEASONS.values())
    | frozenset(lex.WEATHER)
    | frozenset(_HOURS)
    | {"snow", "snowy", "fog", "mist", "rain"}
)
Shares = dict[str, float]


def conditions(texts: Sequence[str], rows: IntArray) -> Shares:
    """The shares of the nodes `rows` (r,) whose texts have each word for season, weather or hour, largest first."""
    met = Counter(w for r in rows for w in {fold(word) for word in words(texts[int(r)])} & _WORDS)
    return {w: n / max(len(rows), 1) for w, n in sorted(met.items(), key=lambda item: (-item[1], item[0]))}


def told(shares: Shares, limit: int = 5) -> str:
    """Conditions in words: `spring (54 of 54 views)`, the commonest first."""
    return ", ".join(f"{w} ({share:.0%})" for w, share in list(shares.items())[:limit] if share >= LEAST)


def differing(texts: Sequence[str], before: IntArray, after: IntArray) -> tuple[str, str]:
    """What of season, weather and hour is told of one visit more than of the other, each in words, or empty."""
    first, second = conditions(texts, before), conditions(texts, after)
    more = {w: s for w, s in first.items() if s - second.get(w, 0.0) >= DIFFERENT}
    less = {w: s for w, s in second.items() if s - first.get(w, 0.0) >= DIFFERENT}
    return told(more), told(less)
