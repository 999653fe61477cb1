"""One writer of a memory at a time."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

from erag.core.errors import MemoryLocked
from erag.core.lockfile import exclusive


def writer_lock(memory: Path, purpose: str) -> AbstractContextManager[None]:
    """Hold the writer's lock of `memory`; raises MemoryLocked naming the holder when it is taken."""

    def taken(holder: str) -> MemoryLocked:
        return MemoryLocked(f"is being written by {holder}", where=str(memory), repair="wait until it is done")

    return exclusive(memory.with_name(memory.name + ".lock"), purpose, taken)
