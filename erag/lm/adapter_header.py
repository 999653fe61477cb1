"""What an adapter's checkpoint says of itself, and what is seen of a query and a card beside their vectors."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict, Field

from erag.core.text import clean, sentences, singular, word_set, words

RULES = 2  # changes when a network would make other numbers of the same texts
FEATURES = ("cosine", "cosine of the head", "best cosine of a part", "share of the query's words")
_LONGEST_PART = 12  # words from which on a sentence is cut at its commas
_COMMON = word_set(
    "a an and any are at be can could do does find for from go have how i if in is it me my near nearest need of on or "
    "place please show somewhere take that the there this to want wanted was we what where which who with would you "
    "your like looking"
)


class AdapterHeader(BaseModel):
    """Shape of the network, the embedder it stands on, and the factor of its logits that makes chances of them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    dim: int = Field(ge=1, le=8192)
    rank: int = Field(ge=1, le=1024)
    members: int = Field(ge=1, le=64)
    known: int = Field(0, ge=0, description="cards seen in training, whose vectors are kept; 0: all are trusted")
    trusted_from: float = Field(0.9, ge=0, lt=1)
    embedder: str
    rules: int = RULES
    slope: float = Field(1.0, gt=0, allow_inf_nan=False)
    offset: float = Field(0.0, allow_inf_nan=False)
    taught_by: str = Field("", max_length=500)


def head(card: str) -> str:
    """What a card begins with: its first sentence, which for a cluster is its name."""
    return (sentences(clean(card)) or [clean(card)])[0]


def parts(card: str) -> tuple[str, ...]:
    """The sentences of a card, long ones cut at their commas."""
    found = [piece.strip() for sentence in sentences(clean(card)) for piece in _cut(sentence)]
    return tuple(dict.fromkeys(piece for piece in found if piece)) or (clean(card),)


def stems(text: str) -> frozenset[str]:
    """The words of a text, common ones apart; plural and singular are one."""
    return frozenset(singular(word) for word in words(text) if word not in _COMMON)


def _cut(sentence: str) -> Sequence[str]:
    return sentence.split(",") if len(words(sentence)) >= _LONGEST_PART else (sentence,)
