"""What each token of a vocabulary can be inside a JSON text: content of a string, the end of one, or a beginning."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from erag.lm.torchlm.vocabulary import Vocabulary

if TYPE_CHECKING:
    import torch

_CHARACTER = r'[^"\\\x00-\x1f\x7f-\x9f\u2028\u2029]|\\["\\]'
_CONTENT = re.compile(f"(?:{_CHARACTER})*")
_AFTER = re.compile(r'"[\s,\]}:\["{]*')  # a quote that ends the string, and what may follow it in one token
_UNIT = re.compile(_CHARACTER)
_BACKSLASH = b"\\"


class Closer(NamedTuple):
    """A token that ends a string: the content before the quote, its characters, and what comes after the quote."""

    content: str
    characters: int
    hint: str  # first character after the quote that is no white space, or ""


class Lexicon:
    """The tokens of one vocabulary, sorted by what they can be. Computed at first use."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary

    @cached_property
    def texts(self) -> list[str | None]:
        """The text of each token; None for control tokens and for parts of characters."""
        return [self._text(i) for i in range(len(self.vocabulary.tokens))]

    @cached_property
    def ids(self) -> dict[str, int]:
        """The token of a text; of equal ones the first."""
        return {text: i for i, text in reversed(list(enumerate(self.texts))) if text}

    @cached_property
    def parts(self) -> dict[bytes, int]:
        """The token of a run of bytes, parts of characters among them; of equal ones the first."""
        spelt = ((i, self.vocabulary.bytes_of(i)) for i in range(len(self.texts)) if i not in self.vocabulary.control)
        return {data: i for i, data in reversed(list(spelt)) if data}

    @cached_property
    def characters(self) -> torch.Tensor:
        """(v,) characters that a token adds to a string, the last perhaps only begun; 0 for tokens that cannot."""
        import torch

        counts = [len(_UNIT.findall(t)) if t and _CONTENT.fullmatch(t) else 0 for t in self.texts]
        for token, (text, _) in self.begun.items():
            counts[token] = len(_UNIT.findall(text)) + 1
        return torch.tensor(counts, dtype=torch.int32)

    @cached_property
    def closers(self) -> dict[int, Closer]:
        """Tokens that end a string."""
        found = {}
        for token, text in enumerate(self.texts):
            if text and '"' in text:
                content = _CONTENT.match(text)
                end = content.end() if content else 0
                if _AFTER.fullmatch(text, end):
                    hint = text[end + 1 :].strip()[:1]
                    found[token] = Closer(text[:end], len(_UNIT.findall(text[:end])), hint)
        return found

    @cached_property
    def closing(self) -> torch.Tensor:
        """(v,) characters that a token adds to a string before it ends it; -1 for tokens that do not end one."""
        import torch

        counts = torch.full((len(self.vocabulary.tokens),), -1, dtype=torch.int32)
        for token, closer in self.closers.items():
            counts[token] = closer.characters
        return counts

    @cached_property
    def begun(self) -> dict[int, tuple[str, bytes]]:
        """Tokens that end within a character: the content before, and the bytes of the character so far.

        That is a backslash, or the first bytes of a character of several where the vocabulary can finish each.
        """
        found = {}
        every_byte = {bytes([b]) for b in range(0x80, 0xC0)} <= set(self.trailing.values())
        for token, text in enumerate(self.texts):
            parts = _hanging(text)
            if text is None and every_byte and token not in self.vocabulary.control:
                parts = _split(self.vocabulary.bytes_of(token))
            if parts and _CONTENT.fullmatch(parts[0]):
                found[token] = parts
        return found

    @cached_property
    def trailing(self) -> dict[int, bytes]:
        """Tokens of nothing but later bytes of a character."""
        every = (
            (i, self.vocabulary.bytes_of(i))
            for i, text in enumerate(self.texts)
            if text is None and i not in self.vocabulary.control
        )
        return {i: data for i, data in every if all(0x80 <= b < 0xC0 for b in data)}

    def going_on(self, begun: bytes, room: int) -> dict[int, tuple[bytes, int]]:
        """Tokens that continue a character: what is still begun after each, and the characters (≤ room) it adds."""
        if begun == _BACKSLASH:
            return {token: (b"", more) for token, more in self._escaped.items() if more <= room}
        found = {}
        for token, data in self.trailing.items():
            joined = begun + data
            parts = _split(joined)
            if parts and not parts[0]:
                found[token] = joined, 0
            elif parts is None and _whole(joined):
                found[token] = b"", 0
        return found

    @cached_property
    def _escaped(self) -> dict[int, int]:
        """Tokens that may follow a backslash, and the characters they add after the one it belongs to."""
        texts = ((i, f"\\{text}") for i, text in enumerate(self.texts) if text and text[0] in '"\\')
        return {i: len(_UNIT.findall(text)) - 1 for i, text in texts if _CONTENT.fullmatch(text)}

    def leading(self, characters: Iterable[str]) -> frozenset[int]:
        """Tokens whose first character that is no white space is one of these."""
        return frozenset().union(*(self._by_lead.get(c, frozenset()) for c in characters))

    @cached_property
    def _by_lead(self) -> dict[str, frozenset[int]]:
        groups: dict[str, set[int]] = {}
        for token, text in enumerate(self.texts):
            if text and (lead := text.lstrip()[:1]):
                groups.setdefault(lead, set()).add(token)
        return {lead: frozenset(group) for lead, group in groups.items()}

    def _text(self, token: int) -> str | None:
        if token in self.vocabulary.control:
            return None
        try:
            return self.vocabulary.bytes_of(token).decode()
        except UnicodeDecodeError:
            return None


def _hanging(text: str | None) -> tuple[str, bytes] | None:
    """Text and the backslash after it; None when no backslash is left alone."""
    return (text[:-1], _BACKSLASH) if text and text[-1] == "\\" and not _CONTENT.fullmatch(text) else None


def _split(data: bytes) -> tuple[str, bytes] | None:
    """Text and the beginning of a character after it; None when the bytes are not that."""
    for cut in range(1, 4):
        head, tail = data[:-cut], data[-cut:]
        try:
            text = head.decode()
        except UnicodeDecodeError:
            continue
        return (text, tail) if _beginning(tail) else None
    return None


def _beginning(data: bytes) -> bool:
    """Whether the bytes are a character that lacks its last bytes: then some way to finish it is valid UTF-8."""
    lacking = {0xC0: 2, 0xD0: 2, 0xE0: 3, 0xF0: 4}.get(data[0] & 0xF0, 0) - len(data)
    if lacking <= 0:
        return False
    fillers = (b"\x80", b"\x90", b"\xbf", b"\xa0")
    return any(_whole(data + first + b"\x80" * (lacking - 1)) for first in fillers)


def _whole(data: bytes) -> bool:
    """Whether the bytes are one character that a JSON string of ours may hold."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return False
    return len(text) == 1 and bool(_CONTENT.fullmatch(text))
