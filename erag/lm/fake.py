"""A deterministic backend without weights, for tests and dry runs. It reads words, it understands nothing."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.text import content_hash, words
from erag.lm.images import load_all
from erag.lm.roles import (
    ROLES,
    Caption,
    Generation,
    Group,
    ImagePath,
    Prompt,
    RoleName,
    SelectTask,
    Summary,
    TextKind,
    Vectors,
)


class FakeConfig(BaseModel):
    """The `fake` backend: the width of its vectors and the size of its batches."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["fake"] = "fake"
    dim: int = Field(64, ge=2, le=4096)
    call_size: int = Field(16, ge=1)
    seed: int = 0


class Fake:
    """All six roles from word counts: texts that share words are similar, and the same input gives the same output."""

    roles: frozenset[RoleName] = frozenset(ROLES)

    def __init__(self, config: FakeConfig | None = None) -> None:
        self._config = config or FakeConfig()

    def identity(self, role: RoleName) -> str:
        return json.dumps({"kind": "fake", "role": role, "dim": self._config.dim, "seed": self._config.seed})

    def fingerprint(self, role: RoleName) -> str:
        return self.identity(role)

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        """A caption that names the image's content hash: equal images have equal captions. Raises BadImages."""
        load_all(images)
        return [Caption(f"A view numbered {hashlib.sha256(p.read_bytes()).hexdigest()[:8]}.") for p in images]

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """Sums of a fixed random direction for each word (a random projection of the bag of words)."""
        del kind
        rows = [self._direction(text) for text in texts]
        return np.stack(rows) if rows else np.empty((0, self._config.dim), np.float32)

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        """The commonest longer words as name, the first text as summary."""
        return [Summary(" ".join(_commonest(g.texts, 3)) or "place", g.texts[0] if g.texts else "") for g in groups]

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        """The cards that share most words with the query; ties by the cards' text, so order does not matter."""
        return [
            sorted(range(len(t.cards)), key=lambda i: (-_overlap(t.query, t.cards[i]), t.cards[i]))[:k] for t in tasks
        ]

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        """The share of the query's words that the text has."""
        return np.array([_overlap(query, text) for query, text in pairs], np.float32)

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """The last message cut to the token cap, or the smallest value the schema admits."""
        return [self._generation(p) for p in prompts]

    def _generation(self, prompt: Prompt) -> Generation:
        spoken = prompt.messages[-1][1].split() if prompt.messages else []
        if prompt.schema is not None:
            return Generation(json.dumps(_smallest(prompt.schema)), tokens_in=len(spoken))
        kept = spoken[: prompt.max_tokens]
        return Generation(" ".join(kept), len(kept) < len(spoken), len(spoken), len(kept))

    def _direction(self, text: str) -> np.ndarray[Any, np.dtype[np.float32]]:
        total = np.zeros(self._config.dim)
        for word in words(text) or [text]:
            seed = int.from_bytes(content_hash(word, str(self._config.seed))[:8], "little")
            total += np.random.default_rng(seed).standard_normal(self._config.dim)
        return (total / np.linalg.norm(total)).astype(np.float32)


def _overlap(query: str, text: str) -> float:
    asked = set(words(query))
    return len(asked & set(words(text))) / len(asked) if asked else 0.0


def _commonest(texts: Sequence[str], n: int) -> list[str]:
    counts = Counter(w for text in texts for w in words(text) if len(w) > 4)
    return [w for w, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))[:n]]


def _smallest(schema: Mapping[str, Any]) -> Any:
    """The smallest value a JSON schema of the kinds we use admits."""
    if "enum" in schema:
        return schema["enum"][0]
    kind = schema.get("type")
    if kind == "object":
        return {key: _smallest(schema["properties"][key]) for key in schema.get("required", ())}
    if kind == "array":
        return [_smallest(schema["items"])] * int(schema.get("minItems", 0))
    if kind in ("integer", "number"):
        return schema.get("minimum", 0)
    return {"boolean": False, "null": None}.get(str(kind), "x" * int(schema.get("minLength", 0)))
