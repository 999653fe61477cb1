"""A backend that records every call: resume, replay, cost and teacher data."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np

from erag.core.errors import EragError
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm import records
from erag.lm.images import read_file
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
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

In = TypeVar("In")
Out = TypeVar("Out")
Key = bytes  # 16 bytes, `content_hash` of fingerprint, parameters and input


class CallStore(Protocol):
    """Where a journal keeps results and attempts. Each method is one transaction."""

    def results(self, keys: Sequence[Key]) -> dict[Key, str]:
        """The recorded results (JSON) among `keys`."""
        ...

    def vectors(self, keys: Sequence[Key]) -> dict[Key, Vectors]:
        """The recorded vectors (d,) float32 among `keys`, at the precision they are stored in."""
        ...

    def begin(self, role: RoleName, fingerprint: str, keys: Sequence[Key]) -> int:
        """Note that a batch is being tried; returns its number."""
        ...

    def finish(self, batch: int, records: Mapping[Key, tuple[str, str]]) -> None:
        """Store (request, result) of every key of a batch and mark the attempt done, all or nothing."""
        ...

    def finish_vectors(self, batch: int, keys: Sequence[Key], vectors: Vectors) -> None:
        """Store the vectors (n, d) of a batch and mark the attempt done, all or nothing."""
        ...

    def fail(self, batch: int, error: str) -> None:
        """Mark an attempt failed; nothing of it is stored."""
        ...


def image_hash(path: ImagePath) -> str:
    """The sha256 (hex) of a file, under which its caption is recorded. Raises BadImages where it cannot be read."""
    return hashlib.sha256(read_file(path)).hexdigest()


def plan(keys: Sequence[Key], sizes: Sequence[int], batch_size: int) -> list[list[int]]:
    """Batches of positions: distinct keys by size and key, cut every `batch_size`.

    The plan depends on the content alone. A resumed run computes only what is missing of each batch, and since a batch
    is stored whole, that is the same set the first run would have computed.
    """
    first = {key: i for i, key in reversed(list(enumerate(keys)))}
    order = sorted(first.values(), key=lambda i: (sizes[i], keys[i]))
    return [order[i : i + batch_size] for i in range(0, len(order), batch_size)]


def call_keys(role: RoleName, fingerprint: str, requests: Sequence[str], parameters: str = "") -> list[Key]:
    """The keys of recorded requests: what was asked, of what, with which parameters (`k=3` of a selection)."""
    return [content_hash(role, fingerprint, parameters, text) for text in requests]


class Journal:
    """An `LMBackend` around another one and a `CallStore`."""

    def __init__(
        self, backend: LMBackend, store: CallStore, ledger: Ledger | None = None, progress: Progress = quiet
    ) -> None:
        self.ledger = ledger or Ledger()
        self._backend, self._store, self._progress = Metered(backend, self.ledger), store, progress

    def identity(self, role: RoleName) -> str:
        return self._backend.identity(role)

    def fingerprint(self, role: RoleName) -> str:
        return self._backend.fingerprint(role)

    def batch_size(self, role: RoleName) -> int:
        return self._backend.batch_size(role)

    def keys(self, role: RoleName, inputs: Sequence[str], parameters: str = "") -> list[Key]:
        """The keys of `inputs` (as recorded text) under this backend's fingerprint."""
        return call_keys(role, self._backend.fingerprint(role), inputs, parameters)

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """As the backend's, at the store's precision, each distinct text computed at most once."""
        keys = self.keys("embed", texts, kind)
        known = self._store.vectors(keys)

        def compute(rows: list[int]) -> None:
            batch = self._store.begin("embed", self.fingerprint("embed"), [keys[i] for i in rows])
            vectors = self._attempt(batch, lambda: self._backend.embed([texts[i] for i in rows], kind))
            self._store.finish_vectors(batch, [keys[i] for i in rows], vectors)

        self._run("embed", keys, [len(t) for t in texts], known, compute)
        known = self._store.vectors(keys)
        return np.stack([known[k] for k in keys]) if keys else np.empty((0, 0), np.float32)

    def caption(self, images: Sequence[ImagePath], hashes: Sequence[str] | None = None) -> list[Caption]:
        """As the backend's, each distinct content at most once. Raises BadImages for a file that cannot be read.

        `hashes` are the `image_hash` of the files: those that are recorded are then not read, and may be gone.
        """
        requests = [image_hash(path) for path in images] if hashes is None else list(hashes)
        return self._calls("caption", images, requests, self._backend.caption, records.CAPTION)

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        return self._calls("summarise", groups, _requests(groups), self._backend.summarise, records.SUMMARY)

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        def call(items: Sequence[SelectTask]) -> list[list[int]]:
            return self._backend.select(items, k)

        return self._calls("select", tasks, _requests(tasks), call, records.SELECTION, f"k={k}")

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        def call(items: Sequence[tuple[str, str]]) -> list[float]:
            return [float(s) for s in self._backend.score(items)]

        return np.array(self._calls("score", pairs, _requests(pairs), call, records.SCORE), np.float32)

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        return self._calls("generate", prompts, _requests(prompts), self._backend.generate, records.GENERATION)

    def _calls(
        self,
        role: RoleName,
        inputs: Sequence[In],
        requests: Sequence[str],
        call: Callable[[Sequence[In]], list[Out]],
        codec: records.Codec[Out],
        parameters: str = "",
    ) -> list[Out]:
        keys = self.keys(role, requests, parameters)
        known = self._store.results(keys)

        def compute(rows: list[int]) -> None:
            batch = self._store.begin(role, self.fingerprint(role), [keys[i] for i in rows])
            results = self._attempt(batch, lambda: call([inputs[i] for i in rows]))
            encoded = {keys[i]: (requests[i], codec.encode(r)) for i, r in zip(rows, results, strict=True)}
            self._store.finish(batch, encoded)
            known.update({key: result for key, (_, result) in encoded.items()})

        self._run(role, keys, [len(r) for r in requests], known, compute)
        return [codec.decode(known[key]) for key in keys]

    def _run(
        self,
        role: RoleName,
        keys: Sequence[Key],
        sizes: Sequence[int],
        known: Mapping[Key, Any],
        compute: Callable[[list[int]], None],
    ) -> None:
        batches = plan(keys, sizes, self.batch_size(role))
        missing = [[i for i in batch if keys[i] not in known] for batch in batches]
        total = sum(map(len, missing))
        self.ledger.replayed[role] += sum(map(len, batches)) - total
        done = 0
        for rows in filter(None, missing):
            self._progress(role, done, total)
            compute(rows)
            done += len(rows)
        if total:
            self._progress(role, total, total)

    def _attempt(self, batch: int, call: Callable[[], Out]) -> Out:
        try:
            return call()
        except EragError as error:
            self._store.fail(batch, error.line())
            raise


def _requests(items: Sequence[Any]) -> list[str]:
    return [records.request_text(item) for item in items]
