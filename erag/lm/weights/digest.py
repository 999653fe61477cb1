"""sha256 of files, in one pass with reading or writing them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

BLOCK = 1 << 20
Seen = Callable[[int], None]


class Stamp(NamedTuple):
    """What tells a changed file from an unchanged one without reading it."""

    size: int
    mtime_ns: int
    inode: int

    @classmethod
    def of(cls, path: Path) -> Stamp:
        info = path.stat()
        return cls(info.st_size, info.st_mtime_ns, info.st_ino)


def sha256_of(path: Path, seen: Seen | None = None) -> str:
    """sha256 of a file as hex; `seen` is told the bytes read so far after each block."""
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while block := file.read(BLOCK):
            digest.update(block)
            size += len(block)
            if seen:
                seen(size)
    return digest.hexdigest()


class Partial:
    """A file being written: its bytes go to disk and into the hash. Bytes of an earlier run can be taken over."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.size = path, 0
        self._file = path.open("r+b" if path.exists() else "w+b")
        self._hash = hashlib.sha256()

    def __enter__(self) -> Partial:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()

    def accept(self, size: int, sha256: str) -> bool:
        """Whether the next `size` bytes on disk have this sha256; if so they count as written."""
        total, own, left = self._hash.copy(), hashlib.sha256(), size
        self._file.seek(self.size)
        while left and (block := self._file.read(min(left, BLOCK))):
            total.update(block)
            own.update(block)
            left -= len(block)
        if left or own.hexdigest() != sha256:
            return False
        self._hash, self.size = total, self.size + size
        return True

    def cut(self) -> None:
        """Drop what is on disk after the bytes that count as written, and write on from there."""
        self._file.seek(self.size)
        self._file.truncate()

    def write(self, block: bytes) -> None:
        self._file.write(block)
        self._hash.update(block)
        self.size += len(block)

    def sync(self) -> None:
        """Make sure that what was written survives a power cut."""
        self._file.flush()
        os.fsync(self._file.fileno())


def replace_durably(source: Path, target: Path) -> None:
    """Rename `source` to `target` atomically, and make the rename itself durable. Both on one filesystem."""
    target.parent.mkdir(parents=True, exist_ok=True)
    source.replace(target)
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def write_durably(path: Path, text: str) -> None:
    """Replace the content of a small file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    with fresh.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    replace_durably(fresh, path)
