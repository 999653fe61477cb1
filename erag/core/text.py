"""Text from the world: cleaned, split into words and sentences, hashed. Never interpreted."""

from __future__ import annotations

import hashlib
import re
import unicodedata

MAX_CAPTION = 4000  # characters kept of one caption; longer ones are reported by the readers

_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])")
_SENTENCE_END = re.compile(r"(?<=[.!?])[\"')\]]*\s+(?=[A-Z0-9\"'(\[])")
_WORD = re.compile(r"[^\W_]+(?:['’][^\W_]+)?")


def clean(text: str) -> str:
    """`text` in NFC with control and format characters dropped and runs of white space folded to one space."""
    kept = (" " if c.isspace() else c for c in unicodedata.normalize("NFC", text))
    return " ".join("".join(c for c in kept if unicodedata.category(c)[0] != "C").split())


def words(text: str) -> list[str]:
    """Lower-case words of `text`, without punctuation."""
    return [w.lower() for w in _WORD.findall(text)]


def name_words(name: str) -> str:
    """A name as words: `fireExtinguisher_wallMount_15` becomes `fire extinguisher wall mount`.

    Numbers are dropped where letters remain, since simulators use them to tell copies apart.
    """
    parts = [p for chunk in re.split(r"[\W_]+", name) for p in _CAMEL.split(chunk) if p]
    kept = [p for p in parts if not p.isdigit()] or parts
    return " ".join(p if p.isupper() and len(p) > 1 else p.lower() for p in kept)


def sentences(text: str) -> list[str]:
    """The sentences of `text` in order; a text without an end mark is one sentence."""
    return [s for s in (part.strip() for part in _SENTENCE_END.split(text)) if s]


def node_text(name: str | None, caption: str | None) -> str:
    """What a node says: its caption, else its name as words, else nothing."""
    return clean(caption or "") or name_words(clean(name or ""))


def content_hash(*parts: str | bytes) -> bytes:
    """A 16-byte key of the parts; parts are length-prefixed, so ("a", "bc") differs from ("ab", "c")."""
    h = hashlib.blake2b(digest_size=16)
    for part in parts:
        raw = part if isinstance(part, bytes) else part.encode("utf-8", "surrogatepass")
        h.update(len(raw).to_bytes(8, "little") + raw)
    return h.digest()
