"""Whether a query asks for a place to go to or for a text, where it does not say."""

from __future__ import annotations

from itertools import pairwise

from erag.core.text import words
from erag.core.types import Query, QueryKind

_EXPLAIN_WORDS = frozenset({"what", "which", "how", "why", "describe", "explain", "summarise", "summarize", "compare"})
_BEFORE = frozenset({"in", "at", "on", "of", "from", "to", "for", "by", "with", "and", "so", "please"})
_FIND_PAIRS = frozenset(
    {("where", "is"), ("where", "are"), ("where", "can"), ("where", "could"), ("take", "me"), ("i", "want"),
     ("show", "me"), ("guide", "me"), ("bring", "me"), ("the", "nearest"), ("the", "closest")}
)  # fmt: skip


def decide_kind(query: Query) -> QueryKind:
    """`query.kind`, or where it is absent what its words ask for: a place to go, or a text."""
    if query.kind is not None:
        return query.kind
    spoken = words(query.text or "")
    if not spoken or any(pair in _FIND_PAIRS for pair in pairwise(spoken)):
        return "find"
    asking = spoken[1] if len(spoken) > 1 and spoken[0] in _BEFORE else spoken[0]  # in which season …
    return "explain" if asking in _EXPLAIN_WORDS else "find"
