"""A query and a card as one row of tokens: what a cross-encoder reads of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from erag.core.errors import ModelError
from erag.lm.bert import tokenizer_of

Ids = tuple[int, ...]  # tokens of a text, without [CLS] and [SEP]
BEGIN, END = "[CLS]", "[SEP]"


@dataclass(frozen=True, slots=True)
class Frame:
    """The tokens that are put around a pair, and how many a row may have in all."""

    begin: int
    end: int
    longest: int

    @property
    def query(self) -> int:
        """The most tokens of a query: half of those that are free, so that there is always room for a card."""
        return (self.longest - 3) // 2

    def cuts(self, query: Ids, card: Ids) -> bool:
        """Whether a pair is longer than what is read of it."""
        return len(query) > self.query or len(query) + len(card) + 3 > self.longest

    def row(self, query: Ids, card: Ids) -> tuple[Ids, Ids]:
        """The halves of a row: [CLS] query [SEP], and as much of the card as fits with [SEP]."""
        first = (self.begin, *query[: self.query], self.end)
        return first, (*card[: self.longest - len(first) - 1], self.end)


class PairTokens:
    """The tokenizer of a BERT's folder; what stands in a text is never one of its special tokens."""

    def __init__(self, folder: Path, longest: int) -> None:
        self._tokenizer = tokenizer_of(folder)
        self._tokenizer.encode_special_tokens = True  # "[SEP]" in a caption is text
        begin, end = (self._tokenizer.token_to_id(name) for name in (BEGIN, END))
        if begin is None or end is None:
            raise ModelError(f"its tokenizer has no {BEGIN} or no {END}", where=str(folder))
        self.frame = Frame(begin, end, longest)

    def encode(self, texts: Sequence[str]) -> list[Ids]:
        """The tokens of each text, same order."""
        return [tuple(e.ids) for e in self._tokenizer.encode_batch(list(texts), add_special_tokens=False)]
