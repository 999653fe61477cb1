"""Text from the world: cleaned, split into words and sentences, hashed. Never interpreted."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Iterator
from functools import lru_cache

MAX_CAPTION = 4000  # characters kept of one caption; longer ones are reported by the readers

_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])")
# Possessive, and one mark at a time: linear in any text.
_SENTENCE_END = re.compile(r"[.!?…][\"'”’»)\]]*+\s++|[。！？।][」』”’）]*+\s*+")
_OPENING = "\"'“‘«([¿¡"
_LAST_TOKEN = re.compile(r"[A-Za-z]+(?:\.[A-Za-z]+)*$")
_ABBREVIATIONS = frozenset({"mr", "mrs", "ms", "dr", "prof", "st", "mt", "vs", "approx", "ca", "fig", "e.g", "i.e"})
_ACRONYM = re.compile(r"[A-Z](?:\.[A-Z])+")
_MAX_MARKS = 30  # combining marks kept in a row (Unicode's stream-safe limit): ordering a longer run is quadratic
_WORD = re.compile(r"[^\W_]+(?:['’][^\W_]+)?")


def clean(text: str) -> str:
    """`text` in NFC with control and format characters dropped and runs of white space folded to one space.

    More than 30 combining marks on one letter are cut to 30.
    """
    if text.isascii() and text.isprintable():
        return " ".join(text.split())
    return " ".join(unicodedata.normalize("NFC", "".join(_visible(text))).split())


def _visible(text: str) -> Iterator[str]:
    marks = 0
    for c in text:
        category = unicodedata.category(c)[0]
        if c.isspace():
            marks = 0
            yield " "
        elif category == "M":
            marks += len(unicodedata.normalize("NFD", c))
            if marks <= _MAX_MARKS:
                yield c
        elif category != "C":
            marks = 0
            yield c


def words(text: str) -> list[str]:
    """Lower-case words of `text`, without punctuation."""
    return [w.lower() for w in _WORD.findall(text)]


@lru_cache(maxsize=1 << 16)
def singular(word: str) -> str:
    """An English plural without its ending: Harman's S stemmer (1991), and `benches`, `boxes`, `grasses` whole."""
    if len(word) < 4 or not word.endswith("s") or word[-2] in "us":
        return word
    if word.endswith("ies") and word[-4] not in "ae":
        return word[:-3] + "y"
    if word.endswith(("sses", "xes", "zes", "ches", "shes")):
        return word[:-2]
    return word[:-1]


def word_set(text: str) -> frozenset[str]:
    """The words of a list written as one text: how closed vocabularies are written down."""
    return frozenset(text.split())


def name_words(name: str) -> str:
    """A name as words: `fireExtinguisher_wallMount_15` becomes `fire extinguisher wall mount`.

    Numbers are dropped where letters remain, since simulators use them to tell copies apart.
    """
    parts = [p for chunk in re.split(r"[\W_]+", name) for p in _CAMEL.split(chunk) if p]
    kept = [p for p in parts if not p.isdigit()] or parts
    return " ".join(p if p.isupper() and len(p) > 1 else p.lower() for p in kept)


def sentences(text: str) -> list[str]:
    """The sentences of `text` in order, closing quotes kept; a text without an end mark is one sentence.

    A mark ends a sentence when white space and then a capital, a digit, an opening quote or a letter of a script
    without capitals follow; not after common abbreviations (`Dr.`, `e.g.`, `U.S.`). Linear in the text's length.
    """
    parts, start = [], 0
    for mark in _SENTENCE_END.finditer(text):
        if _ends_sentence(text, mark):
            parts.append(text[start : mark.end()])
            start = mark.end()
    return [s for s in (part.strip() for part in (*parts, text[start:])) if s]


def _ends_sentence(text: str, mark: re.Match[str]) -> bool:
    following = text[mark.end() : mark.end() + 1]
    if mark[0][0] in "。！？।" or not following:
        return True
    if following.islower() or not (following.isalnum() or following in _OPENING):
        return False
    if mark[0][0] != "." or not mark[0][1].isspace():
        return True
    token = _LAST_TOKEN.search(text[max(0, mark.start() - 12) : mark.start()])
    return token is None or not (token[0].lower() in _ABBREVIATIONS or _ACRONYM.fullmatch(token[0]))


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
