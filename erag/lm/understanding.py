"""The `understanding` backend: names what would satisfy a query, without a language model; other prompts go to one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError, RoleMissing
from erag.core.types import IntArray
from erag.lm.adapter import EmbedderConfig, embedder_of
from erag.lm.checkpoints import check_embedder, load_tensors, read_header, shipped
from erag.lm.ledger import Ledger
from erag.lm.roles import Generation, Generator, Prompt, RoleName, Vectors
from erag.lm.sentence import SentenceConfig
from erag.lm.weights import ModelStore

HEADER = "understanding"
RULES = 1  # changes when other things would be named by the same numbers
SHIPPED = "understanding.safetensors"
REPAIR = "erag distil --config configs/distil/understanding.yaml"
ASKED = "things"  # the only property of the schema under which things are named
_ALIKE = 0.85  # cosine from which on two things are one


class UnderstandingConfig(BaseModel):
    """The `understanding` backend: a checkpoint (None: the one that comes with the project) over an embedder.

    It names things; every other prompt is given to the model with the key `otherwise` (None: such a prompt is refused).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["understanding"] = "understanding"
    checkpoint: Path | None = None
    embedder: EmbedderConfig = SentenceConfig()
    otherwise: str | None = None
    call_size: int = Field(64, ge=1, le=65_536, description="prompts recorded together")


class UnderstandingHeader(BaseModel):
    """The things a student knows, the embedder it stands on, and how its parts are weighed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    dim: int = Field(ge=1, le=8192)
    embedder: str
    rules: int = RULES
    blend: float = Field(ge=0, allow_inf_nan=False)
    taught_by: str = Field("", max_length=500)
    things: tuple[str, ...] = Field(min_length=1)


@dataclass(frozen=True, eq=False)
class Names:
    """What a student knows: unit vectors `things` (t, d), `projection` (d, d) of queries, `prior` (t,) of things."""

    things: Vectors
    projection: Vectors
    prior: Vectors
    blend: float

    def scores(self, queries: Vectors) -> Vectors:
        """(q, t): cosine of query and thing + `blend` × product of projected query and thing + prior of the thing."""
        projected = queries @ (np.eye(len(self.projection), dtype=np.float32) + self.blend * self.projection)
        return np.asarray(projected @ self.things.T + self.prior, np.float32)


class OtherGenerator(Generator, Protocol):
    """A model that generates and says what it is."""

    def identity(self, role: RoleName) -> str: ...

    def fingerprint(self, role: RoleName) -> str: ...


class Understanding:
    """The generate role for prompts that ask for things; what it answers is JSON of their schema."""

    roles: frozenset[RoleName] = frozenset({"generate"})

    def __init__(
        self,
        config: UnderstandingConfig,
        store: ModelStore,
        ledger: Ledger | None = None,
        otherwise: OtherGenerator | None = None,
    ) -> None:
        self._config, self._otherwise = config, otherwise
        self._embedder = embedder_of(config.embedder, store, ledger)
        self._path = config.checkpoint or shipped(SHIPPED)
        self._digest: str | None = None
        self._loaded: tuple[UnderstandingHeader, Names] | None = None

    def identity(self, role: RoleName) -> str:
        """The checkpoint's bytes, the embedder's weights, and the other model; ModelError where there is none."""
        if self._digest is None:
            read_header(self._path, HEADER, UnderstandingHeader, REPAIR)
            self._digest = hashlib.sha256(self._path.read_bytes()).hexdigest()
        other = self._otherwise.identity(role) if self._otherwise else None
        parts = {"kind": "understanding", "weights": self._digest, "otherwise": other}
        return json.dumps({**parts, "embedder": self._embedder.identity("embed")}, sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        other = self._otherwise.fingerprint(role) if self._otherwise else None
        run = {"embedder": self._embedder.fingerprint("embed"), "otherwise": other}
        return json.dumps({**json.loads(self.identity(role)), **run}, sort_keys=True)

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """One generation a prompt, same order. Raises RoleMissing for other prompts where no model takes them."""
        mine = [i for i, prompt in enumerate(prompts) if _most(prompt) is not None]
        theirs = [i for i, prompt in enumerate(prompts) if _most(prompt) is None]
        found: dict[int, Generation] = {}
        if theirs:
            if self._otherwise is None:
                what = "this model names things and writes nothing else"
                raise RoleMissing(what, where="generate", repair="name another model in its `otherwise`")
            found.update(zip(theirs, self._otherwise.generate([prompts[i] for i in theirs]), strict=True))
        named = self.things([prompts[i].messages[-1][1] for i in mine], [_most(prompts[i]) or 1 for i in mine])
        for i, things in zip(mine, named, strict=True):
            found[i] = Generation(json.dumps({ASKED: things}, ensure_ascii=False))
        return [found[i] for i in range(len(prompts))]

    def things(self, queries: Sequence[str], most: Sequence[int]) -> list[tuple[str, ...]]:
        """What would satisfy each query, most fitting first, no two alike, at most `most` of them."""
        if not queries:
            return []
        header, names = self._load()
        scores = names.scores(self._embedder.embed(queries, "query"))
        return [
            tuple(header.things[row] for row in distinct(own, names.things, count))
            for own, count in zip(scores, most, strict=True)
        ]

    def _load(self) -> tuple[UnderstandingHeader, Names]:
        if self._loaded is None:
            header = read_header(self._path, HEADER, UnderstandingHeader, REPAIR)
            check_embedder(self._path, header, self._embedder, RULES, REPAIR)
            self._loaded = header, load_names(self._path, header)
        return self._loaded


def load_names(path: Path, header: UnderstandingHeader) -> Names:
    """What a checkpoint knows. Raises ModelError where its tensors do not fit its header."""
    tensors = load_tensors(path, REPAIR)
    shapes = {
        "things": (len(header.things), header.dim), "projection": (header.dim, header.dim),
        "prior": (len(header.things),),
    }  # fmt: skip
    found = {name: tensor.shape for name, tensor in tensors.items()}
    if found != shapes:
        raise ModelError(
            f"its tensors do not fit its header: {found}", where=str(path), allowed=str(shapes), repair=REPAIR
        )
    things = tensors["things"]
    unit = things / np.maximum(np.linalg.norm(things, axis=1, keepdims=True), 1e-12)
    return Names(unit, tensors["projection"], tensors["prior"], header.blend)


def distinct(scores: Vectors, vectors: Vectors, most: int) -> IntArray:
    """Rows by score (t,), best first, leaving out those alike to a better one (cosine of `vectors` (t, d))."""
    kept: list[int] = []
    for row in np.lexsort((np.arange(len(scores)), -scores)):
        if len(kept) == most:
            break
        if not kept or (vectors[kept] @ vectors[row]).max() < _ALIKE:
            kept.append(int(row))
    return np.array(kept, np.int64)


def _most(prompt: Prompt) -> int | None:
    """How many things a prompt asks for; None for a prompt that asks for something else."""
    schema: Mapping[str, Any] = prompt.schema or {}
    properties = schema.get("properties")
    if not isinstance(properties, Mapping) or set(properties) != {ASKED}:
        return None
    return int(properties[ASKED].get("maxItems", 5))
