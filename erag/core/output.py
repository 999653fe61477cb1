"""Files we write: complete or not at all, never over a memory, a device, or a folder."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

from erag.core.errors import InputError

_SQLITE = b"SQLite format 3\x00"


@contextmanager
def replacing(path: Path, *inputs: Path) -> Iterator[TextIO]:
    """A text file that takes the place of `path` when the block ends well; links are followed, folders made.

    Raises InputError, changing nothing, when `path` is a folder, a device or a memory file, is one of `inputs`, or
    cannot be written.
    """
    with replacing_bytes(path, *inputs) as raw:
        file = io.TextIOWrapper(raw, encoding="utf-8", errors="backslashreplace")
        try:
            yield file
            file.flush()
        finally:
            file.detach()


@contextmanager
def replacing_bytes(path: Path, *inputs: Path) -> Iterator[BinaryIO]:
    """As `replacing`, for a file of bytes."""
    target = _target(path, inputs)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.name[:100]}.", suffix=".partial", dir=target.parent)
        partial = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            partial.chmod(0o666 & ~_umask())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", where=str(path)) from error


def _target(path: Path, inputs: tuple[Path, ...]) -> Path:
    try:
        target = path.resolve()
        exists, regular = target.exists(), target.is_file()
        same = exists and any(i.exists() and i.samefile(target) for i in inputs)
        head = target.open("rb").read(len(_SQLITE)) if regular else b""
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"cannot be written: {error}", where=str(path)) from error
    if not path.name or (exists and not regular):
        raise InputError("is not a regular file", where=str(path), allowed="the name of a file to write")
    if same or head == _SQLITE:
        raise InputError("would be overwritten", where=str(path), allowed="a name that no input has")
    return target


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
