"""What things are good for: a lexicon by which a wish finds what it does not name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from erag.core.errors import ConfigError
from erag.core.text import content_hash
from erag.core.types import IntArray
from erag.lm.roles import Embedder, RoleName, Vectors
from erag.retrieve.lexical import LexicalIndex, tokens

Floats = npt.NDArray[np.float64]
SHIPPED, VECTORS = "uses.yaml", "uses.npz"  # the vectors: 8-bit, by MiniLM; scripts/embed_uses.py
MAX_BYTES = 4 << 20
BELOW = -3.0  # the standard score of a text that mentions no thing of the lexicon
NOTHING = (BELOW, 0.0) * 3  # all that is said of such a text


class Use(BaseModel):
    """An entry: other names of a thing (`also`), its purposes, what people say who need it, what goes with it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    also: tuple[str, ...] = ()
    purposes: tuple[str, ...] = Field((), alias="for")
    said: tuple[str, ...] = ()
    goes_with: tuple[str, ...] = Field((), alias="with")

    @property
    def texts(self) -> tuple[str, ...]:
        """All that is compared with a wish."""
        return (*self.purposes, *self.said, *self.goes_with)


def read_uses(path: Path | None = None) -> Mapping[str, Use]:
    """The lexicon of a file, else the shipped one. Raises ConfigError for a file that is none."""
    where = path or Path(str(files("erag.retrieve").joinpath(SHIPPED)))
    try:
        if where.stat().st_size > MAX_BYTES:
            raise ConfigError("too large", where=str(where), allowed=f"up to {MAX_BYTES:,} bytes")
        return TypeAdapter(dict[str, Use]).validate_python(_parsed(where.read_text("utf-8")) or {})
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"cannot be read: {error}", where=str(where)) from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        at = ".".join(str(part) for part in first["loc"])
        raise ConfigError(f"{at}: {first['msg']}", where=str(where), allowed="NAME: {also, for, said, with}") from error


def _parsed(text: str) -> Any:
    """What a YAML text says, by the parser in C where PyYAML was built with it: ten times as fast."""
    return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506


def lexicon_texts(uses: Mapping[str, Use]) -> list[str]:
    """What is embedded of a lexicon: the texts of all entries (t), then their names (k)."""
    return [*(text for use in uses.values() for text in use.texts), *uses]


class KnownEmbedder(Embedder, Protocol):
    """An embedder that says which it is."""

    def identity(self, role: RoleName) -> str: ...


def shipped_lexicon(embedder: KnownEmbedder) -> Lexicon:
    """The shipped lexicon, with the vectors that are shipped for MiniLM; another embedder makes its own (some 10 s)."""
    uses = _shipped()
    texts = lexicon_texts(uses)
    stored = _stored(made_of(texts, embedder.identity("embed")))
    return Lexicon.of(uses, embedder.embed(texts, "document") if stored is None else stored)


@lru_cache(maxsize=1)
def _shipped() -> Mapping[str, Use]:
    """Read once a process, however many memories are opened."""
    return read_uses()


def made_of(texts: Sequence[str], identity: str) -> str:
    """What stored vectors depend on: the texts and the embedder."""
    return content_hash(identity, *texts).hex()


@lru_cache(maxsize=1)
def _stored(key: str) -> Vectors | None:
    path = Path(str(files("erag.retrieve").joinpath(VECTORS)))
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as stored:
        if str(stored["key"]) != key:
            return None
        vectors = stored["vectors"].astype(np.float32)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), np.float32)


@dataclass(frozen=True)
class Lexicon:
    """Things with the vectors of their texts (t, d), `owner` (t,) the thing of each, and of their names (k, d)."""

    uses: Mapping[str, Use]
    vectors: Vectors
    owner: IntArray
    names: Vectors

    @classmethod
    def of(cls, uses: Mapping[str, Use], vectors: Vectors) -> Lexicon:
        """With the vectors (t + k, d) of `lexicon_texts`."""
        sizes = [len(use.texts) for use in uses.values()]
        owner = np.repeat(np.arange(len(uses)), sizes)
        return cls(uses, vectors[: len(owner)], owner, vectors[len(owner) :])

    def likeness(self, vector: Vectors) -> Floats:
        """(k, 3): cosines of a wish (d,) and each thing: the nearest of its texts, all on average, its name."""
        cosines = (self.vectors @ vector).astype(np.float64)
        best, total = np.full(len(self.uses), -1.0), np.zeros(len(self.uses))
        np.maximum.at(best, self.owner, cosines)
        np.add.at(total, self.owner, cosines)
        each = np.bincount(self.owner, minlength=len(self.uses))
        return np.stack([best, total / np.maximum(each, 1), self.names @ vector], axis=1)


class Uses:
    """The things of a lexicon that the texts of a map mention, and how well they would serve a wish."""

    def __init__(self, lexicon: Lexicon, index: LexicalIndex) -> None:
        self._lexicon, self._count = lexicon, index.count
        found = [_mentions(index, name, use) for name, use in lexicon.uses.items()]
        self._here = np.flatnonzero([len(rows) > 0 for rows in found])
        rows = np.concatenate([found[i] for i in self._here]) if len(self._here) else np.empty(0, np.int64)
        things = np.repeat(np.arange(len(self._here)), [len(found[i]) for i in self._here])
        order = np.argsort(rows, kind="stable")
        self._things = things[order]  # of the rows that mention any, row by row
        self._rows, self._first = np.unique(rows[order], return_index=True)

    def scores(self, vector: Vectors) -> Floats:
        """(n, 6): for each of the three likenesses, of the best thing a text mentions: its standard score, 1 / rank.

        Both among the things that this map mentions; `BELOW` and 0 for a text that mentions none.
        """
        out = np.tile(np.array(NOTHING), (self._count, 1))
        if not len(self._here):
            return out
        likeness = self._lexicon.likeness(vector)[self._here]
        standard = (likeness - likeness.mean(0)) / (likeness.std(0) + 1e-6)
        rank = np.argsort(np.argsort(-likeness, axis=0, kind="stable"), axis=0, kind="stable")
        for kind in range(3):
            best = np.minimum.reduceat(rank[:, kind][self._things], self._first)  # equal likeness, equal standard score
            of_rank = np.sort(standard[:, kind])[::-1]
            out[self._rows, 2 * kind] = of_rank[best]
            out[self._rows, 2 * kind + 1] = 1 / (1 + best)
        return out


def _mentions(index: LexicalIndex, name: str, use: Use) -> IntArray:
    rows = [index.phrase_rows(tokens(called)) for called in (name, *use.also)]
    return np.unique(np.concatenate(rows))
