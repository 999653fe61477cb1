"""Texts to tokens and back, from the vocabulary and merges in a GGUF file; agrees with llama.cpp's tokenisation."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from erag.core.errors import ModelError
from erag.lm.chat import ChatTemplate, Piece
from erag.lm.torchlm.container import Container

if TYPE_CHECKING:
    from tokenizers import Tokenizer

_CONTROL, _USER = 3, 4  # token types of GGUF
_GPT2 = r"'s|'t|'re|'ve|'m|'ll|'d| ?\p{L}+| ?\p{N}+| ?[^\s\p{L}\p{N}]+|\s+(?!\S)"
_CASELESS = r"(?:'[sS]|'[tT]|'[rR][eE]|'[vV][eE]|'[mM]|'[lL][lL]|'[dD])|[^\r\n\p{L}\p{N}]?\p{L}+|"
_TAIL = r"| ?[^\s\p{L}\p{N}]+[\r\n]*|\s*[\r\n]+|\s+(?!\S)|\s+"
_SPLITS = {  # tokenizer.ggml.pre: where words are cut, one expression after the other, as llama.cpp does
    "smollm": (r"\p{N}", _GPT2),
    "qwen2": (_CASELESS + r"\p{N}" + _TAIL,),
    "gpt-2": (_GPT2,),
    "llama-bpe": (_CASELESS + r"\p{N}{1,3}" + _TAIL,),
}
_WHOLE_WORDS_FIRST = frozenset({"llama-bpe"})  # a word that is a token needs no merges


class Vocabulary:
    """The tokens of a model. Raises ModelError for kinds of tokenisers that are not computed here."""

    def __init__(self, file: Container) -> None:
        kind, self._pre = file.text("tokenizer.ggml.model"), file.text("tokenizer.ggml.pre") or ""
        if kind != "gpt2" or self._pre not in _SPLITS:
            allowed = f"gpt2 with {', '.join(_SPLITS)} (others run in the llamacpp backend)"
            raise ModelError(f"tokeniser {kind!r} {self._pre!r}", where=file.path.name, allowed=allowed)
        self.tokens = file.strings("tokenizer.ggml.tokens")
        self._merges = file.strings("tokenizer.ggml.merges")
        kinds = file.integers("tokenizer.ggml.token_type")
        if len(kinds) != len(self.tokens):
            raise ModelError(f"{len(kinds)} token types for {len(self.tokens)} tokens", where=file.path.name)
        self.control = frozenset(i for i, k in enumerate(kinds) if k == _CONTROL)
        self._named = {self.tokens[i]: i for i, k in enumerate(kinds) if k in (_CONTROL, _USER)}
        self._user = frozenset(i for i, k in enumerate(kinds) if k == _USER)
        bos, eos = (self._token(file, f"tokenizer.ggml.{name}_token_id") for name in ("bos", "eos"))
        self.ends = self.control | ({eos} if eos is not None else frozenset())  # a text stops before any of these
        self._bos = bos if file.metadata.get("tokenizer.ggml.add_bos_token", False) else None
        self.template = ChatTemplate(
            file.text("tokenizer.chat_template"),
            bos="" if bos is None else self.tokens[bos],
            eos="" if eos is None else self.tokens[eos],
            where=f"chat template of {file.path.name}",
        )

    def _token(self, file: Container, key: str) -> int | None:
        if key not in file.metadata:
            return None
        token = int(file.number(key))
        if not 0 <= token < len(self.tokens):
            raise ModelError(f"{key} is {token}", where=file.path.name, allowed=f"below {len(self.tokens)}")
        return token

    def encode(self, text: str) -> list[int]:
        """Tokens of plain text; what looks like a control token is spelt out."""
        return list(self._tokenizer.encode(text, add_special_tokens=False).ids)

    def encode_chat(self, pieces: Sequence[Piece]) -> list[int]:
        """Tokens of a rendered chat: control tokens where the template's own text names them, and nowhere else."""
        ids: list[int] = []
        plain = ""
        for text, token in self._runs(pieces):
            plain += text
            if token is not None:
                ids += [*self.encode(plain), token]
                plain = ""
        ids += self.encode(plain)
        return [self._bos, *ids] if self._bos is not None and ids[:1] != [self._bos] else ids

    def _runs(self, pieces: Sequence[Piece]) -> Iterable[tuple[str, int | None]]:
        """Plain text, each time with the control token that ends it, if one does."""
        for piece in pieces:
            if not piece.frame:
                yield piece.text, None
                continue
            at = 0
            for match in self._control_texts.finditer(piece.text):
                yield piece.text[at : match.start()], self._named[match.group()]
                at = match.end()
            yield piece.text[at:], None

    def decode(self, ids: Iterable[int]) -> str:
        """The text of tokens without control tokens. A character that is cut off at the end is left out."""
        data = b"".join(self.bytes_of(i) for i in ids if i not in self.control)
        return codecs.getincrementaldecoder("utf-8")("replace").decode(data)

    def bytes_of(self, token: int) -> bytes:
        """The bytes a token stands for."""
        text = self.tokens[token]
        if token in self._user or token in self.control:
            return text.encode()
        return b"".join(_BYTES.get(c, c.encode()) for c in text)

    @cached_property
    def _control_texts(self) -> re.Pattern[str]:
        names = sorted(self._named, key=len, reverse=True)
        return re.compile("|".join(map(re.escape, names)) or r"(?!)")

    @cached_property
    def _tokenizer(self) -> Tokenizer:
        from tokenizers import Regex, Tokenizer, models, pre_tokenizers

        merges = [(left, right) for left, _, right in (merge.partition(" ") for merge in self._merges)]
        words = {token: i for i, token in enumerate(self.tokens) if token not in self._named}
        whole = self._pre in _WHOLE_WORDS_FIRST
        tokenizer = Tokenizer(models.BPE(vocab=words, merges=merges, ignore_merges=whole))
        cuts = [pre_tokenizers.Split(Regex(split), "isolated") for split in _SPLITS[self._pre]]
        spell = pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False)
        tokenizer.pre_tokenizer = pre_tokenizers.Sequence([*cuts, spell])
        return tokenizer


def _byte_letters() -> dict[str, bytes]:
    """GPT-2's letter for each byte: itself where it is printable, else one from 256 on."""
    printable = [*range(ord("!"), ord("~") + 1), *range(ord("¡"), ord("¬") + 1), *range(ord("®"), ord("ÿ") + 1)]
    others = [b for b in range(256) if b not in printable]
    letters = {chr(b): bytes([b]) for b in printable}
    return letters | {chr(256 + i): bytes([b]) for i, b in enumerate(others)}


_BYTES = _byte_letters()
