"""Several models behind one `LMBackend`, and the checks every role's results must pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np

from erag.core.errors import BadModelOutput, ConfigError, RoleMissing
from erag.lm.roles import (
    ROLES,
    Caption,
    Captioner,
    Embedder,
    Generation,
    Generator,
    Group,
    ImagePath,
    LMBackend,
    Model,
    Prompt,
    RoleName,
    Roles,
    Scorer,
    Selector,
    SelectTask,
    Summariser,
    Summary,
    TextKind,
    Vectors,
)

T = TypeVar("T")
UNIT_TOLERANCE = 1e-2  # rows rounded to float16 still pass


def compose(models: Mapping[str, Model], roles: Roles) -> LMBackend:
    """One backend from `models`; raises ConfigError for a role given to a model that is absent or cannot play it."""
    for role, key in roles.assigned.items():
        where = f"roles.{role}"
        if role not in ROLES:
            raise ConfigError(f"unknown role {role!r}", where="roles", allowed=", ".join(ROLES))
        if key not in models:
            raise ConfigError(f"no model {key!r}", where=where, allowed=", ".join(sorted(models)) or "(none)")
        if role not in models[key].roles:
            able = ", ".join(sorted(models[key].roles))
            raise ConfigError(f"model {key!r} cannot play this role", where=where, allowed=f"its roles: {able}")
    return Composed(models, roles)


class Composed:
    """The `LMBackend` that `compose` returns: routes each role to its model and checks what comes back."""

    def __init__(self, models: Mapping[str, Model], roles: Roles) -> None:
        self._models, self._roles = dict(models), dict(roles.assigned)

    def _model(self, role: RoleName) -> Any:
        if role not in self._roles:
            has = ", ".join(sorted(self._roles)) or "none"
            raise RoleMissing(f"no model plays the role {role!r}", allowed=f"roles with a model: {has}")
        return self._models[self._roles[role]]

    def identity(self, role: RoleName) -> str:
        return cast(str, self._model(role).identity(role))

    def fingerprint(self, role: RoleName) -> str:
        return cast(str, self._model(role).fingerprint(role))

    def batch_size(self, role: RoleName) -> int:
        return cast(int, self._model(role).batch_size(role))

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        model: Captioner = self._model("caption")
        return _same_length("caption", images, model.caption(images))

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        model: Embedder = self._model("embed")
        return check_vectors(texts, model.embed(texts, kind))

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        model: Summariser = self._model("summarise")
        return _same_length("summarise", groups, model.summarise(groups))

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        model: Selector = self._model("select")
        chosen = _same_length("select", tasks, model.select(tasks, k))
        for task, picks in zip(tasks, chosen, strict=True):
            n, wanted = len(task.cards), min(k, len(task.cards))
            if len(picks) != wanted or len(set(picks)) != wanted or any(not 0 <= i < n for i in picks):
                raise BadModelOutput(f"selected {picks} of {n} cards", allowed=f"{wanted} distinct indices below {n}")
        return chosen

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        model: Scorer = self._model("score")
        scores = np.asarray(model.score(pairs), np.float32)
        inside = np.isfinite(scores) & (scores >= 0) & (scores <= 1)
        if scores.shape != (len(pairs),) or not inside.all():
            raise BadModelOutput(f"{scores.shape} scores for {len(pairs)} pairs", allowed="one in [0, 1] a pair")
        return scores

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        model: Generator = self._model("generate")
        return _same_length("generate", prompts, model.generate(prompts))


def check_vectors(texts: Sequence[str], vectors: Vectors) -> Vectors:
    """`vectors` as they are when they are (n, d), finite and unit; else BadModelOutput naming the first bad text."""
    if vectors.ndim != 2 or len(vectors) != len(texts):
        raise BadModelOutput(f"vectors of shape {vectors.shape} for {len(texts)} texts", allowed="one row a text")
    bad = ~np.isfinite(vectors).all(axis=1) | (np.abs(np.linalg.norm(vectors, axis=1) - 1) > UNIT_TOLERANCE)
    if bad.any():
        raise BadModelOutput(f"no unit vector for the text {texts[int(bad.argmax())][:80]!r}", allowed="unit rows")
    return vectors


def _same_length(role: str, inputs: Sequence[Any], outputs: list[T]) -> list[T]:
    if len(outputs) != len(inputs):
        raise BadModelOutput(f"{role} gave {len(outputs)} results for {len(inputs)} inputs", allowed="one an input")
    return outputs
