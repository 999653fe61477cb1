"""The `replay` backend: answers from call records alone, and says precisely what it has none of."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ConfigError, ModelError, printable
from erag.lm.callfile import Record, Source, read_calls
from erag.lm.images import read_file
from erag.lm.journal import Key, call_keys
from erag.lm.records import CODECS, request_text
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

_SHOWN = 80  # characters of a request, of a fingerprint


class ReplayConfig(BaseModel):
    """The `replay` backend: a file of `erag records export`.

    `of` says by a part of its fingerprint whose records a role is answered from, where several models played it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["replay"] = "replay"
    records: Path
    of: dict[RoleName, str] = {}
    call_size: int = Field(1024, ge=1, le=65_536, description="items recorded together in one transaction")


class NotRecorded(ModelError):
    """Requests that were never answered in these records: `missing` of `asked` calls of `role`."""

    def __init__(self, role: RoleName, missing: Sequence[str], asked: int, source: Source, path: Path) -> None:
        self.role, self.missing, self.asked = role, len(missing), asked
        what = f"no record of {len(missing)} of {asked} {role} calls, such as {printable(missing[0], _SHOWN)!r}"
        super().__init__(
            f"{what}, by {printable(source.fingerprint, _SHOWN)}",
            where=str(path),
            repair=f"make these calls with the model itself, then erag records export M.erag --out {path}",
        )


class Replay:
    """All six roles, as far as they were recorded. The file is read at the first call."""

    roles: frozenset[RoleName] = frozenset(ROLES)

    def __init__(self, config: ReplayConfig) -> None:
        self._config = config

    def identity(self, role: RoleName) -> str:
        """The recorded identity, so that vectors can be compared with those of the model; else the fingerprint."""
        source = self._source(role)
        return source.identity or source.fingerprint

    def fingerprint(self, role: RoleName) -> str:
        """That of the recorded model, to the last bit: a journal finds the same keys."""
        return self._source(role).fingerprint

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        requests = [hashlib.sha256(read_file(path)).hexdigest() for path in images]
        shown = [f"{path.name} (sha256 {digest[:12]}…)" for path, digest in zip(images, requests, strict=True)]
        return self._decoded("caption", requests, shown=shown)

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """(n, d) float32 unit rows, as a memory gives them back. Raises NotRecorded."""
        found = [r.vector for r in self._found("embed", texts, kind, texts) if r.vector is not None]
        if not found:
            return np.empty((0, 0), np.float32)
        if len({len(v) for v in found}) != 1:
            raise ModelError("vectors of different widths", where=str(self._config.records))
        rows = np.stack(found).astype(np.float32)
        unit: Vectors = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        return unit

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        return self._decoded("summarise", _requests(groups))

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        return self._decoded("select", _requests(tasks), f"k={k}")

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        return np.array(self._decoded("score", _requests(pairs)), np.float32)

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        return self._decoded("generate", _requests(prompts))

    def _decoded(
        self, role: RoleName, requests: Sequence[str], parameters: str = "", shown: Sequence[str] = ()
    ) -> list[Any]:
        found = self._found(role, requests, parameters, shown or requests)
        return [CODECS[role].decode(record.result) for record in found]

    def _found(self, role: RoleName, requests: Sequence[str], parameters: str, shown: Sequence[str]) -> list[Record]:
        source = self._source(role)
        keys = call_keys(role, source.fingerprint, requests, parameters)
        missing = {key: text for key, text in zip(keys, shown, strict=True) if key not in self._records}
        if missing:
            raise NotRecorded(role, list(missing.values()), len(set(keys)), source, self._config.records)
        return [self._records[key] for key in keys]

    def _source(self, role: RoleName) -> Source:
        """Whose records a role is answered from. Raises ModelError where there is none, ConfigError where several."""
        wanted = self._config.of.get(role, "")
        found = [s for s in self._sources if s.role == role and wanted in s.fingerprint]
        if len(found) == 1:
            return found[0]
        path = str(self._config.records)
        if not found:
            has = sorted({s.role for s in self._sources})
            what = f"no {role} calls are recorded{f' of {wanted!r}' if wanted else ''}"
            repair = f"erag records export M.erag --out {path}, of a memory that made them"
            raise ModelError(what, where=path, allowed=f"recorded roles: {', '.join(has) or 'none'}", repair=repair)
        allowed = " | ".join(printable(s.fingerprint, _SHOWN) for s in found)
        raise ConfigError(
            f"{len(found)} models played {role!r}", where=path, allowed=allowed, repair=f"of: {{{role}: PART}}"
        )

    @cached_property
    def _file(self) -> tuple[tuple[Source, ...], Mapping[Key, Record]]:
        read = read_calls(self._config.records)
        return read.sources, {record.key: record for record in read.records}

    @property
    def _sources(self) -> tuple[Source, ...]:
        return self._file[0]

    @property
    def _records(self) -> Mapping[Key, Record]:
        return self._file[1]


def _requests(items: Sequence[Any]) -> list[str]:
    return [request_text(item) for item in items]
