"""Whether a query asks for a place to go to or for a text, where it does not say."""

from __future__ import annotations

from itertools import pairwise

from erag.core.text import words
from erag.core.types import Query, QueryKind

_EXPLAIN_WORDS = frozenset({"what", "which", "how", "why", "describe", "explain", "summarise", "summarize", "compare"})
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
    return "explain" if spoken[0] in _EXPLAIN_WORDS else "find"
