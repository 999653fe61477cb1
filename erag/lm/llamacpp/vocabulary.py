"""The vocabulary of a loaded model: text to tokens and back; text from the world never becomes a control token."""

from __future__ import annotations

import codecs
import ctypes
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Literal

from erag.core.errors import ModelError
from erag.lm.chat import Piece

_UNKNOWN, _CONTROL = 1 << 0, 1 << 3  # llama_token_attr
_LSTRIP, _RSTRIP = 1 << 7, 1 << 8  # the token swallows white space before, after it
_PIECE = 256  # bytes of most pieces


class Vocabulary:
    """Tokens of one model. `library` are the bindings, `handle` the native vocabulary, owned by the model."""

    def __init__(self, library: Any, handle: Any, where: str) -> None:
        self._llama, self._handle, self._where = library, handle, where
        self.size: int = library.llama_vocab_n_tokens(handle)
        self._bos: int = library.llama_vocab_bos(handle)
        self._last_tokens = (library.llama_vocab_eos(handle), library.llama_vocab_eot(handle))
        self._bytes: dict[int, bytes] = {}

    def token_text(self, name: Literal["bos", "eos"]) -> str:
        """The text of the `bos` or `eos` token, empty where the model has none."""
        token = self._bos if name == "bos" else self._last_tokens[0]
        return self._text(token) if 0 <= token < self.size else ""

    @cached_property
    def control(self) -> frozenset[int]:
        """Tokens that steer a chat: they end an answer and are never read out of a message."""
        marked = {t for t, attributes in enumerate(self._attributes) if attributes & _CONTROL}
        return frozenset(marked | {t for t in self._last_tokens if 0 <= t < self.size})

    @cached_property
    def steering(self) -> frozenset[int]:
        """Control tokens that do not end an answer."""
        return frozenset(t for t in self.control if not self._llama.llama_vocab_is_eog(self._handle, t))

    def encode(self, text: str) -> list[int]:
        """Tokens of plain text; what looks like a control token is spelt out."""
        tokens = self._tokenise(text)
        bad = next((t for t in tokens if t in self.control and self._attributes[t] & _CONTROL), None)
        if bad is None:
            return tokens
        at = text.find(self._text(bad)) + 1  # cut inside it: neither half can be it
        if not 0 < at < len(text):
            raise ModelError(f"its tokeniser makes the control token {self._text(bad)!r} of text", where=self._where)
        return self.encode(text[:at]) + self.encode(text[at:])

    def encode_chat(self, pieces: Sequence[Piece]) -> list[int]:
        """Tokens of a rendered chat: control tokens where the template's own text names them, and nowhere else."""
        tokens: list[int] = []
        plain = ""
        for text, token in self._runs(pieces):
            plain += text
            if token is None:
                continue
            tokens += self.encode(plain.rstrip() if self._attributes[token] & _LSTRIP else plain)
            tokens.append(token)
            plain = ""
        tokens += self.encode(plain)
        if self._llama.llama_vocab_get_add_bos(self._handle) and tokens[:1] != [self._bos]:
            return [self._bos, *tokens]
        return tokens

    def decode(self, tokens: Iterable[int], *, cut: bool = False) -> str:
        """The text of tokens without control tokens; with `cut`, a character that is cut off at the end is left out."""
        data = b"".join(self.bytes_of(t) for t in tokens)
        return codecs.getincrementaldecoder("utf-8")("replace").decode(data, final=not cut)

    def bytes_of(self, token: int) -> bytes:
        """The bytes a token stands for; none for a control token."""
        if token not in self._bytes:
            self._bytes[token] = self._piece(token)
        return self._bytes[token]

    def _piece(self, token: int) -> bytes:
        size = _PIECE
        while True:
            buffer = ctypes.create_string_buffer(size)
            length = self._llama.llama_token_to_piece(self._handle, token, buffer, size, 0, False)
            if length >= 0:
                return buffer.raw[:length]
            size = -length

    def _tokenise(self, text: str) -> list[int]:
        data = text.encode("utf-8", "replace")
        if not data:
            return []
        room = len(data) + 8
        tokens = (ctypes.c_int32 * room)()
        count = self._llama.llama_tokenize(self._handle, data, len(data), tokens, room, False, False)
        if count < 0:
            raise ModelError(f"its tokeniser makes {-count} tokens of {len(data)} bytes", where=self._where)
        return list(tokens[:count])

    def _runs(self, pieces: Sequence[Piece]) -> Iterable[tuple[str, int | None]]:
        """Plain text, each time with the control token that ends it, if one does."""
        strip = False
        for piece in pieces:
            if not piece.frame:
                yield piece.text, None
                strip = False
                continue
            at = 0
            for match in self._special.finditer(piece.text):
                plain = piece.text[at : match.start()]
                token = self._named[match.group()]
                yield plain.lstrip() if strip else plain, token
                at, strip = match.end(), bool(self._attributes[token] & _RSTRIP)
            rest = piece.text[at:]
            yield rest.lstrip() if strip else rest, None
            strip = strip and not rest

    def _text(self, token: int) -> str:
        text: bytes = self._llama.llama_vocab_get_text(self._handle, token) or b""
        return text.decode("utf-8", "replace")

    @cached_property
    def _attributes(self) -> list[int]:
        return [int(self._llama.llama_vocab_get_attr(self._handle, t)) for t in range(self.size)]

    @cached_property
    def _named(self) -> dict[str, int]:
        named = {self._text(t): t for t, a in enumerate(self._attributes) if a & (_CONTROL | _UNKNOWN)}
        return {text: token for text, token in named.items() if text}

    @cached_property
    def _special(self) -> re.Pattern[str]:
        names = sorted(self._named, key=len, reverse=True)
        return re.compile("|".join(map(re.escape, names)) or r"(?!)")
