"""The memory file as a whole: opened to read, or to write under the writer's lock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from erag.core.errors import MemoryFileError
from erag.memory.calls import Calls
from erag.memory.database import Database, Mode
from erag.memory.generations import Generations
from erag.memory.lock import writer_lock
from erag.memory.observations import Observations


class MemoryFile:
    """A memory file (`*.erag`): observations, call records with vectors, and the forest built from them."""

    def __init__(self, path: Path, mode: Mode) -> None:
        self.path = _resolved(path)  # locks and journals lie beside the file itself, not beside a link to it
        self.db = Database(self.path, mode)
        self.observations = Observations(self.db)
        self.calls = Calls(self.db)
        self.generations = Generations(self.db)

    def close(self) -> None:
        self.db.close()

    @classmethod
    @contextmanager
    def reading(cls, path: Path) -> Iterator[MemoryFile]:
        """Open for reading; many may read while one writes."""
        memory = cls(path, "read")
        try:
            yield memory
        finally:
            memory.close()

    @classmethod
    @contextmanager
    def writing(cls, path: Path, purpose: str, *, create: bool = False) -> Iterator[MemoryFile]:
        """Open for writing under the lock, made first when `create` and absent. Raises MemoryLocked when taken."""
        path = _resolved(path)
        if not path.parent.is_dir():
            raise MemoryFileError("no such folder", where=str(path.parent), repair=f"mkdir -p {path.parent}")
        with writer_lock(path, purpose):
            if create and not path.exists():
                Database.create(path)
            memory = cls(path, "write")
            try:
                yield memory
            finally:
                memory.close()


def _resolved(path: Path) -> Path:
    try:
        full = path.resolve()
        if full.is_dir():
            raise MemoryFileError("is a folder", where=str(path), allowed="the name of a memory file")
    except (OSError, RuntimeError, ValueError) as error:
        raise MemoryFileError(f"no file can be there: {error}", where=str(path)) from error
    return full
