"""One process at a time changes a model's files; the others are told which one."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

from erag.core.errors import ModelError
from erag.core.lockfile import exclusive


def hold(path: Path, model: str) -> AbstractContextManager[None]:
    """Hold the lock file `path` while the block runs. Raises ModelError naming the holder when it is taken."""

    def taken(holder: str) -> ModelError:
        return ModelError(
            f"its files are being changed by {holder}", where=model, repair="wait until it is done, or stop it"
        )

    path.parent.mkdir(parents=True, exist_ok=True)
    return exclusive(path, "erag models", taken)
