"""Models that llama.cpp computes: tried in a child process before they are loaded here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from erag.core.cores import cores
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.probe import Probe, cache_folder
from erag.lm.local import CallSized, LocalModel
from erag.lm.weights import ModelStore


class ProbeWish(CallSized, Protocol):
    """A configuration that says how long a probe may take, and on how many threads (None: as many as CPUs)."""

    @property
    def probe_seconds(self) -> float: ...

    @property
    def threads(self) -> int | None: ...


Config = TypeVar("Config", bound=ProbeWish)


class ProbedModel(LocalModel[Config]):
    """A `Model` in llama.cpp.

    `cache` is where choices and converted weights are kept (default: the user's cache folder); `command` replaces the
    child's command in tests.
    """

    def __init__(
        self,
        config: Config,
        store: ModelStore,
        ledger: Ledger | None = None,
        *,
        cache: Path | None = None,
        command: Sequence[str] = (),
    ) -> None:
        super().__init__(config, store, ledger)
        self._cache, self._command = cache, tuple(command)

    @property
    def _threads(self) -> int:
        return self._config.threads or cores()

    def _probe(self) -> Probe:
        return Probe(
            folder=self._cache or cache_folder(), seconds=self._config.probe_seconds, threads=self._threads,
            command=self._command, ledger=self._ledger,
        )  # fmt: skip
