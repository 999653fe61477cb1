"""A backend that counts: how many items of each role were computed, and how long it took."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from erag.lm.ledger import Ledger
from erag.lm.roles import (
    Caption,
    Generation,
    Group,
    ImagePath,
    LMBackend,
    Prompt,
    RoleName,
    SelectTask,
    Summary,
    TextKind,
    Vectors,
)

Out = TypeVar("Out")


class Metered:
    """An `LMBackend` around another one; items that raise are not counted, but for the seconds they took."""

    def __init__(self, backend: LMBackend, ledger: Ledger) -> None:
        self._backend, self.ledger = backend, ledger

    def identity(self, role: RoleName) -> str:
        return self._backend.identity(role)

    def fingerprint(self, role: RoleName) -> str:
        return self._backend.fingerprint(role)

    def batch_size(self, role: RoleName) -> int:
        return self._backend.batch_size(role)

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        return self._counted("caption", len(images), lambda: self._backend.caption(images))

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        return self._counted("embed", len(texts), lambda: self._backend.embed(texts, kind))

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        return self._counted("summarise", len(groups), lambda: self._backend.summarise(groups))

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        return self._counted("select", len(tasks), lambda: self._backend.select(tasks, k))

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        return self._counted("score", len(pairs), lambda: self._backend.score(pairs))

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        return self._counted("generate", len(prompts), lambda: self._backend.generate(prompts))

    def _counted(self, role: RoleName, items: int, call: Callable[[], Out]) -> Out:
        start = time.perf_counter()
        try:
            result = call()
        finally:
            self.ledger.seconds[role] += time.perf_counter() - start
        self.ledger.calls[role] += items
        return result
