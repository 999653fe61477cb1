"""The `understanding` backend: names what would satisfy a query, without a language model; other prompts go to one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError, RoleMissing
from erag.core.types import IntArray
from erag.lm.adapter import EmbedderConfig, embedder_of
from erag.lm.adapter_header import RULES, AdapterHeader, stems
from erag.lm.checkpoints import load_into, read_header, shipped
from erag.lm.ledger import Ledger
from erag.lm.roles import Generation, Generator, Prompt, RoleName, Vectors
from erag.lm.sentence import SentenceConfig
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    import torch

    from erag.lm.understanding_network import UnderstandingNetwork

HEADER = "understanding"
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


class UnderstandingHeader(AdapterHeader):
    """The header of an adapter, the things it knows, and what was named for each taught wish (rows of `things`)."""

    things: tuple[str, ...] = Field(min_length=1)
    named: tuple[tuple[int, ...], ...] = Field(min_length=1)


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
        self._loaded: tuple[UnderstandingHeader, UnderstandingNetwork] | None = None

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
        import torch

        if not queries:
            return []
        header, network = self._load()
        vectors = self._embedder.embed(queries, "query")
        common = shares(queries, header.things)
        with torch.inference_mode():
            chances = network.chances(torch.from_numpy(vectors), torch.from_numpy(common)).numpy()
        known: Vectors = network.get_buffer("things").numpy()
        return [
            tuple(header.things[row] for row in distinct(own, known, count))
            for own, count in zip(chances, most, strict=True)
        ]

    def _load(self) -> tuple[UnderstandingHeader, UnderstandingNetwork]:
        if self._loaded is None:
            header = read_header(self._path, HEADER, UnderstandingHeader, REPAIR)
            found = self._embedder.identity("embed")
            if (found, RULES) != (header.embedder, header.rules):
                what = f"was trained on vectors of {header.embedder} (rules {header.rules})"
                raise ModelError(what, where=str(self._path), allowed=f"{found} (rules {RULES})", repair=REPAIR)
            self._loaded = header, load_network(self._path, header)
        return self._loaded


def load_network(path: Path, header: UnderstandingHeader) -> UnderstandingNetwork:
    """The network of a checkpoint, ready. Raises ModelError where its weights do not fit its header."""
    from erag.lm.understanding_network import UnderstandingNetwork

    network = UnderstandingNetwork(header, len(header.things), len(header.named))
    load_into(path, network, REPAIR)
    network.named = taught_chances(header)
    return network


def taught_chances(header: UnderstandingHeader) -> torch.Tensor:
    """(w, t) float32: what was named for each wish, earlier names counting more, each row with sum 1."""
    import torch

    rows = torch.zeros(len(header.named), len(header.things))
    for row, things in zip(rows, header.named, strict=True):
        if any(not 0 <= thing < len(header.things) for thing in things):
            raise ModelError("names a thing that it does not know", where="header", repair=REPAIR)
        for place, thing in enumerate(things):
            row[thing] += 1 / (1 + place)
    return rows / rows.sum(dim=1, keepdim=True).clamp_min(1e-9)


def shares(queries: Sequence[str], things: Sequence[str]) -> Vectors:
    """(q, t) float32: the share of a query's words, common ones apart, that stand in a thing."""
    known = [stems(thing) for thing in things]
    out = np.zeros((len(queries), len(things)), np.float32)
    for row, query in zip(out, queries, strict=True):
        asked = stems(query)
        if asked:
            row[:] = [len(asked & thing) / len(asked) for thing in known]
    return out


def distinct(chances: Vectors, vectors: Vectors, most: int) -> IntArray:
    """Rows by chance (t,), best first, leaving out those alike to a better one (cosine of `vectors` (t, d))."""
    kept: list[int] = []
    for row in np.lexsort((np.arange(len(chances)), -chances)):
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
