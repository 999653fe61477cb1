"""One process at a time: a lock file that says who holds it, freed by the system however that process ends."""

from __future__ import annotations

import fcntl
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from erag.core.errors import EragError, InputError

MAX_HOLDER = 300  # bytes of the holder's note that are read


@contextmanager
def exclusive(path: Path, purpose: str, taken: Callable[[str], EragError]) -> Iterator[None]:
    """Hold the lock file `path` while the block runs; the file goes when it ends.

    Raises `taken(holder)` when somebody else has it (in this process or another), InputError when it cannot be made.
    """
    try:
        handle = _acquire(path, taken)
    except OSError as error:
        raise InputError(f"no lock file: {error.strerror}", where=str(path), allowed="a writable folder") from error
    try:
        _sign(handle, path, purpose)
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _sign(handle: int, path: Path, purpose: str) -> None:
    note = f"{purpose}, process {os.getpid()} on {socket.gethostname()}, since {time.ctime()}"
    try:
        os.ftruncate(handle, 0)
        os.write(handle, note.encode())
    except OSError as error:
        raise InputError(f"no lock file: {error.strerror}", where=str(path), repair="free disk space") from error


def _acquire(path: Path, taken: Callable[[str], EragError]) -> int:
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, MAX_HOLDER).decode(errors="replace")
            os.close(handle)
            raise taken(holder or "another process") from None
        if _is_current(path, handle):
            return handle
        os.close(handle)  # its holder removed the file between our open and our lock


def _is_current(path: Path, handle: int) -> bool:
    try:
        return path.stat().st_ino == os.fstat(handle).st_ino
    except FileNotFoundError:
        return False
