"""An SQLite file opened with care: recognised before use, errors in one line, short transactions."""

from __future__ import annotations

import errno
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

from erag.core.errors import MemoryFileError
from erag.memory.schema import APPLICATION_ID, TABLES, UPGRADES, VERSION

_MAGIC = b"SQLite format 3\x00"
_BUSY_SECONDS = 20.0
_COMMIT_SECONDS = 0.1
Mode = Literal["read", "write"]


class Database:
    """A connection to a memory file. `read` never changes it; `write` is opened under the writer's lock."""

    def __init__(self, path: Path, mode: Mode) -> None:
        self.path = path
        if not path.is_file():
            raise MemoryFileError("no such memory file", where=str(path), repair="erag ingest SOURCE --out FILE.erag")
        check_header(path)
        uri = f"file:{quote(str(path.resolve()))}?mode=rw"  # a reader too may have to roll back a killed writer
        with translated(path):
            self._connection = sqlite3.connect(uri, uri=True, timeout=_BUSY_SECONDS, isolation_level=None)
            self._connection.execute(f"PRAGMA query_only = {int(mode == 'read')}")
            self._connection.execute("PRAGMA foreign_keys = ON")
            self._connection.execute("PRAGMA synchronous = FULL")
            self._check_version(mode)
            if mode == "read":
                self._connection.execute("BEGIN")  # one snapshot for all that is read

    @classmethod
    def create(cls, path: Path) -> None:
        """Make an empty memory file; the file appears complete or not at all."""
        partial = path.with_name(path.name + ".new")
        with translated(path):
            for leftover in (partial, path.with_name(path.name + "-journal")):  # of a killed run on a deleted file
                leftover.unlink(missing_ok=True)
            connection = sqlite3.connect(partial, isolation_level=None)
            try:
                marks = f"PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {VERSION};"
                connection.executescript(f"BEGIN; {marks} {TABLES} COMMIT;")
            finally:
                connection.close()
            partial.replace(path)

    def close(self) -> None:
        self._connection.close()

    def rows(self, sql: str, parameters: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of a SELECT."""
        with translated(self.path):
            return self._connection.execute(sql, parameters).fetchall()

    def value(self, sql: str, parameters: Sequence[Any] = ()) -> Any:
        """The first column of the first row, or None."""
        found = self.rows(sql, parameters)
        return found[0][0] if found else None

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """All or nothing: committed at the end of the block, undone at any exception or death."""
        with translated(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def _check_version(self, mode: Mode) -> None:
        """Raise MemoryFileError for a foreign file or version; a writer brings an older version up to date."""
        application = self._connection.execute("PRAGMA application_id").fetchone()[0]
        version = self._connection.execute("PRAGMA user_version").fetchone()[0]
        if application != APPLICATION_ID:
            self.close()
            raise MemoryFileError("an SQLite file of another program", where=str(self.path), allowed="a memory file")
        while mode == "write" and version in UPGRADES:
            script = f"BEGIN; {UPGRADES[version]} PRAGMA user_version = {version + 1}; COMMIT;"
            self._connection.executescript(script)
            version += 1
        if version != VERSION:
            self.close()
            repair = f"erag build {self.path}" if version in UPGRADES else "ingest its sources again"
            raise MemoryFileError(
                f"schema version {version}", where=str(self.path), allowed=f"{VERSION}", repair=repair
            )


def check_header(path: Path) -> None:
    """Raise MemoryFileError for a file that is not SQLite, or that is shorter than its header says."""
    size, expected = _sizes(path)
    if size < expected and not path.with_name(path.name + "-journal").exists():
        time.sleep(_COMMIT_SECONDS)  # a writer may just have finished between two looks
        size, expected = _sizes(path)
    if size < expected and not path.with_name(path.name + "-journal").exists():
        raise MemoryFileError(
            f"truncated: {size} of {expected} bytes",
            where=str(path),
            repair="restore a copy, or ingest its sources again",
        )


def _sizes(path: Path) -> tuple[int, int]:
    """Bytes the file has, and bytes its header says it has."""
    try:
        with path.open("rb") as file:
            header = file.read(100)
        size = path.stat().st_size
    except OSError as error:
        raise MemoryFileError(f"cannot be read: {error.strerror}", where=str(path)) from error
    if len(header) < 100 or not header.startswith(_MAGIC):
        raise MemoryFileError("not a memory file", where=str(path), allowed="a file made by `erag ingest`")
    page = int.from_bytes(header[16:18], "big")
    return size, int.from_bytes(header[28:32], "big") * (65_536 if page == 1 else page)


@contextmanager
def undamaged(path: Path) -> Iterator[None]:
    """What cannot be decoded from a memory as one line: the file was changed by something else."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError) as error:
        what = f"damaged: {type(error).__name__} {error}"
        raise MemoryFileError(what, where=str(path), repair="restore a copy, or ingest its sources again") from error


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """SQLite's and the system's errors as one-line errors of ours; what was committed before stays readable."""
    try:
        yield
    except OSError as error:
        raise MemoryFileError(f"{error.strerror}", where=str(path), repair=_repair(error)) from error
    except sqlite3.Error as error:
        raise MemoryFileError(str(error), where=str(path), repair=_repair(error)) from error


def _repair(error: sqlite3.Error | OSError) -> str:
    code = "SQLITE_FULL" if getattr(error, "errno", 0) == errno.ENOSPC else getattr(error, "sqlite_errorname", "")
    hints = {
        "SQLITE_FULL": "free disk space and run the command again; what was done is kept",
        "SQLITE_IOERR": "check the disk and run the command again; what was done is kept",
        "SQLITE_BUSY": "wait for the other process to finish",
        "SQLITE_READONLY": "make the file and its folder writable",
        "SQLITE_CANTOPEN": "make the file and its folder readable and writable",
        "SQLITE_CORRUPT": "restore a copy, or ingest its sources again",
        "SQLITE_NOTADB": "restore a copy, or ingest its sources again",
    }
    return next((hint for prefix, hint in hints.items() if code.startswith(prefix)), "erag inspect FILE.erag")
