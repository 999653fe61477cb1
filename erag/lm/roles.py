"""The six roles a model can play, and what goes in and out of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

TextKind = Literal["query", "document"]
RoleName = Literal["caption", "embed", "summarise", "select", "score", "generate"]
ROLES: tuple[RoleName, ...] = ("caption", "embed", "summarise", "select", "score", "generate")
Vectors = npt.NDArray[np.float32]  # (n, d), unit rows
ImagePath = Path


@dataclass(frozen=True, slots=True)
class Caption:
    """A captioner's view of one image: a sentence or more, and the objects it is sure to see."""

    text: str
    objects: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Group:
    """A cluster to be summarised: texts of representative members, and facts computed by code over all members."""

    texts: tuple[str, ...]
    facts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Summary:
    """What a summariser says of a group: a short name, a few sentences, relations between the things in it."""

    name: str
    text: str
    relationships: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SelectTask:
    """One choice of phase 1: the query and a card (text) per candidate."""

    query: str
    cards: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Prompt:
    """What a generator is asked: chat messages (role, text), a JSON schema or None, a token cap and a seed."""

    messages: tuple[tuple[str, str], ...]
    schema: Mapping[str, Any] | None = None
    max_tokens: int = 256
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Generation:
    """A generator's answer. `truncated` says that the token cap ended it."""

    text: str
    truncated: bool = False
    tokens_in: int = 0
    tokens_out: int = 0


class Captioner(Protocol):
    """Images to captions."""

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        """One caption an image, same order. Raises BadModelOutput when the model gives none."""
        ...


class Embedder(Protocol):
    """Texts to vectors."""

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """(n, d) float32 with unit rows, same order. Raises BadModelOutput for rows that are not finite or are zero."""
        ...


class Summariser(Protocol):
    """Groups of member texts to summaries (paper: what is kept on a new node)."""

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        """One summary a group, same order."""
        ...


class Selector(Protocol):
    """Phase 1: `N_l = f_LM(q, C_l, k)`."""

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        """For each task min(k, n) distinct indices of its cards, best first; independent of the order of the cards."""
        ...


class Scorer(Protocol):
    """Phase 2: relevance of a text to a query."""

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        """(n,) float32 in [0, 1] for (query, text) pairs, same order."""
        ...


class Generator(Protocol):
    """Prompts to text."""

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """One generation a prompt, same order. Raises BadModelOutput when a schema was asked and not met."""
        ...


class Writer(Embedder, Generator, Protocol):
    """What writing needs: vectors to choose what is told, and text."""


class LMBackend(Captioner, Embedder, Summariser, Selector, Scorer, Generator, Protocol):
    """All six roles behind one object; `compose` builds one from several models."""

    def identity(self, role: RoleName) -> str:
        """Weights, template and parameters of a role: vectors of equal identity can be compared with each other."""
        ...

    def fingerprint(self, role: RoleName) -> str:
        """What determines the results of a role to the last bit: its identity, dtype and runtime version."""
        ...

    def batch_size(self, role: RoleName) -> int:
        """How many items of a role go into one call; a constant, so that the batch plan depends on content alone."""
        ...


class Model(Protocol):
    """Weights that can play some of the roles: it has the methods of the roles it lists."""

    @property
    def roles(self) -> frozenset[RoleName]: ...

    def identity(self, role: RoleName) -> str: ...

    def fingerprint(self, role: RoleName) -> str: ...

    def batch_size(self, role: RoleName) -> int: ...


@dataclass(frozen=True)
class Roles:
    """Which model (by its key in `compose`'s mapping) plays each role; a role without a model is missing."""

    assigned: Mapping[RoleName, str] = field(default_factory=dict)
