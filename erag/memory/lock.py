"""One writer at a time: a lock file beside the memory that says who holds it, freed by the system at any exit."""

from __future__ import annotations

import fcntl
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from erag.core.errors import MemoryFileError, MemoryLocked


@contextmanager
def writer_lock(memory: Path, purpose: str) -> Iterator[None]:
    """Hold the writer's lock of `memory`; raises MemoryLocked naming the holder when it is taken."""
    path = memory.with_name(memory.name + ".lock")
    try:
        handle = _acquire(path, memory)
    except OSError as error:
        raise MemoryFileError(
            f"cannot lock: {error.strerror}", where=str(memory), allowed="a writable folder"
        ) from error
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{purpose}, process {os.getpid()} on {socket.gethostname()}, since {time.ctime()}".encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _acquire(path: Path, memory: Path) -> int:
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, 300).decode(errors="replace") or "another process"
            os.close(handle)
            raise MemoryLocked(
                f"is being written by {holder}", where=str(memory), repair="wait until it is done"
            ) from None
        if _is_current(path, handle):
            return handle
        os.close(handle)  # its holder removed the file between our open and our lock


def _is_current(path: Path, handle: int) -> bool:
    try:
        return path.stat().st_ino == os.fstat(handle).st_ino
    except FileNotFoundError:
        return False
