"""Reading the GGUF container: metadata, vocabulary and the table of tensors, each length checked before it is used.

The `gguf` package reads it too, but takes seconds for a vocabulary (one array a token); this takes a tenth of one.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from erag.core.errors import ModelError

_MAGIC, _VERSIONS = b"GGUF", (2, 3)
_MAX_ENTRIES, _MAX_TENSORS, _MAX_DIMS, _MAX_NAME, _MAX_DEPTH = 65_536, 65_536, 4, 1024, 2
_STRING, _ARRAY = 8, 9
_NUMBERS = {0: "B", 1: "b", 2: "H", 3: "h", 4: "I", 5: "i", 6: "f", 7: "?", 10: "Q", 11: "q", 12: "d"}
_SIZE = struct.Struct("<Q")
_ALIGNMENT = "general.alignment"


@dataclass(frozen=True, slots=True)
class TensorEntry:
    """A tensor of the table: its shape (outermost first), its GGML type and where its bytes begin in the file."""

    name: str
    shape: tuple[int, ...]
    kind: int
    start: int


@dataclass(frozen=True, slots=True)
class Container:
    """What a GGUF file says before its tensor bytes. `metadata`: plain values, numpy arrays, lists of strings."""

    path: Path
    metadata: dict[str, Any]
    tensors: dict[str, TensorEntry]

    def number(self, key: str, default: float | None = None) -> float:
        """A number of the metadata. Raises ModelError where it is absent without a default, or no number."""
        value = self.metadata.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ModelError(f"{key} is {value!r}, expected a number", where=self.path.name)
        return value

    def text(self, key: str) -> str | None:
        """A string of the metadata, None where it is absent. Raises ModelError where it is something else."""
        value = self.metadata.get(key)
        if value is not None and not isinstance(value, str):
            raise ModelError(f"{key} is {value!r}, expected a string", where=self.path.name)
        return value

    def strings(self, key: str) -> list[str]:
        """A list of strings of the metadata. Raises ModelError where it is absent or something else."""
        value = self.metadata.get(key)
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise ModelError(f"{key} is absent or no list of strings", where=self.path.name)
        return value

    def integers(self, key: str) -> list[int]:
        """A list of integers of the metadata. Raises ModelError where it is absent or something else."""
        value = self.metadata.get(key)
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "iu":
            raise ModelError(f"{key} is absent or no list of integers", where=self.path.name)
        return [int(v) for v in value]


def open_container(path: Path) -> Container:
    """Read the head of a GGUF file. Raises ModelError for anything that is not a whole, little-endian GGUF 2 or 3."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _Reader(path, data).container()
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        raise ModelError(f"not a whole GGUF file: {error}", where=path.name, repair="erag models verify") from error


class _Reader:
    def __init__(self, path: Path, data: mmap.mmap) -> None:
        self._path, self._data, self._at = path, data, 0

    def container(self) -> Container:
        magic, version = self._data[:4], struct.unpack_from("<I", self._data, 4)[0]
        if magic != _MAGIC or version not in _VERSIONS:
            raise ModelError(f"magic {magic!r}, version {version}", where=self._path.name, allowed="GGUF 2 or 3")
        self._at = 8
        tensors, entries = self._number("Q"), self._number("Q")
        self._bound("tensors", tensors, _MAX_TENSORS)
        self._bound("metadata entries", entries, _MAX_ENTRIES)
        metadata = {self._string(): self._value(self._number("I")) for _ in range(entries)}
        table = [self._tensor() for _ in range(tensors)]
        alignment = metadata.get(_ALIGNMENT, 32)
        self._bound(_ALIGNMENT, alignment, 1 << 20, least=1)
        base = -(-self._at // alignment) * alignment
        placed = (TensorEntry(t.name, t.shape, t.kind, base + t.start) for t in table)
        return Container(self._path, metadata, {t.name: t for t in placed})

    def _number(self, code: str) -> Any:
        form = f"<{code}"
        value = struct.unpack_from(form, self._data, self._at)[0]
        self._at += struct.calcsize(form)
        return value

    def _string(self) -> str:
        size = self._number("Q")
        self._bound("bytes of a string", size, len(self._data) - self._at)
        self._at += size
        return str(self._data[self._at - size : self._at], "utf-8")

    def _value(self, kind: int, depth: int = 0) -> Any:
        if kind == _STRING:
            return self._string()
        if kind == _ARRAY and depth < _MAX_DEPTH:
            return self._array(depth + 1)
        if kind not in _NUMBERS:
            raise ModelError(f"a value of the unknown type {kind}", where=self._path.name)
        return self._number(_NUMBERS[kind])

    def _array(self, depth: int) -> Any:
        kind, count = self._number("I"), self._number("Q")
        self._bound("array elements", count, len(self._data) - self._at)
        if kind == _STRING:
            return self._strings(count)
        if kind not in _NUMBERS:
            return [self._value(kind, depth) for _ in range(count)]
        dtype = np.dtype(_NUMBERS[kind]).newbyteorder("<")
        self._bound("array bytes", count * dtype.itemsize, len(self._data) - self._at)
        self._at += count * dtype.itemsize
        return np.frombuffer(self._data[self._at - count * dtype.itemsize : self._at], dtype)

    def _strings(self, count: int) -> list[str]:
        """A list of strings: a vocabulary, so this loop is the one that takes time."""
        data, at, found = self._data, self._at, []
        for _ in range(count):
            (size,) = _SIZE.unpack_from(data, at)
            at += 8 + size
            if at > len(data):
                self._bound("bytes of a string", size, len(data) - at + size)
            found.append(str(data[at - size : at], "utf-8"))
        self._at = at
        return found

    def _tensor(self) -> TensorEntry:
        name, dims = self._string(), self._number("I")
        self._bound("dimensions", dims, _MAX_DIMS, least=1)
        self._bound("characters of a name", len(name), _MAX_NAME, least=1)
        shape = tuple(self._number("Q") for _ in range(dims))
        for size in shape:
            self._bound(f"size of {name}", size, 1 << 31, least=1)
        return TensorEntry(name, shape[::-1], self._number("I"), self._number("Q"))

    def _bound(self, what: str, value: int, most: int, least: int = 0) -> None:
        if not isinstance(value, int) or not least <= value <= most:
            raise ModelError(f"{value} {what}", where=self._path.name, allowed=f"{least} to {most}")
