"""How far a long job on files is: a protocol for whoever shows it, and a watch over a folder that fills."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

INTERVAL_S = 0.25


class Progress(Protocol):
    """Told what is being done, with the bytes done so far and the bytes in all (None = unknown)."""

    def update(self, what: str, done: int, total: int | None) -> None: ...


class Silent:
    """Shows nothing."""

    def update(self, what: str, done: int, total: int | None) -> None:
        del what, done, total


@contextmanager
def watching(folder: Path, seen: Callable[[int], None]) -> Iterator[None]:
    """While the block runs, tell `seen` again and again the size of the largest file under `folder`: the download."""
    done = threading.Event()

    def watch() -> None:
        while not done.wait(INTERVAL_S):
            seen(largest_under(folder))

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def largest_under(folder: Path) -> int:
    """Size of the largest file under `folder`; files that come and go while it is walked do not count."""
    largest = 0
    for parent, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                largest = max(largest, (Path(parent) / name).lstat().st_size)
    return largest
