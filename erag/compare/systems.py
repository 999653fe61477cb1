"""Whole systems: how each builds memories of its own of the environments of a trial, and is asked."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from erag.bench.memory import peak_mb
from erag.compare.config import SystemSpec
from erag.compare.trial import Taken
from erag.compare.whole import TOP
from erag.core.output import replacing
from erag.core.text import content_hash
from erag.data.contract import QueryLine
from erag.evaluate.dataset import Environment
from erag.lm.config import build_backend
from erag.lm.roles import LMBackend, RoleName
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.pipeline.build import BUILD_VERSION, build
from erag.pipeline.config import PipelineConfig, load_config
from erag.pipeline.ingest import ingest
from erag.pipeline.query import Asker, metered

BUILDING: tuple[RoleName, ...] = ("caption", "embed", "summarise")  # the roles a build calls


@dataclass(frozen=True)
class Built:
    """What it took to build memories: seconds in all, and the largest resident size of a process."""

    seconds: float = 0.0
    peak_mb: float = 0.0


@dataclass(frozen=True)
class System:
    """A system over the environments of a trial; its memories lie in `folder`, `given` states the cloud's forest."""

    spec: SystemSpec
    environments: Mapping[str, Environment]
    folder: Path
    store: ModelStore
    given: Path | None = None

    @cached_property
    def config(self) -> PipelineConfig:
        return load_config(self.spec.preset, overrides=self.spec.overrides)

    @cached_property
    def _backend(self) -> LMBackend:
        return build_backend(self.config.backend, self.store)

    def fingerprint(self) -> str:
        """Of all that its answers depend on but the sources."""
        models = {role: self._backend.fingerprint(role) for role in self.config.backend.roles}
        return json.dumps([self.config.model_dump(mode="json"), self.spec.forest, models], sort_keys=True)

    def path(self, environment: str) -> Path:
        """Its memory of an environment, by all that it is built from; systems that build alike share it."""
        built = self.config.model_dump_json(exclude={"retrieve", "aware", "answer", "backend"})
        models = [self._backend.fingerprint(role) for role in BUILDING if role in self.config.backend.roles]
        source = str(self._source(environment).resolve())
        key = content_hash(source, built, self.spec.forest, str(BUILD_VERSION), *models).hex()[:12]
        return self.folder / f"{environment}-{key}.erag"

    def _source(self, environment: str) -> Path:
        own = self.environments[environment].source
        return self.given if self.spec.forest == "given" and self.given is not None else own

    def build(self, environment: Environment) -> None:
        """Build one memory anew in this process, and keep beside it what that took."""
        path, start = self.path(environment.name), time.perf_counter()
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in path.parent.glob(f"{path.name}*"):  # of a build that was killed, which would take less than it does
            left.unlink()
        ingest(self._source(environment.name), path, environment.reader)
        with MemoryFile.writing(path, "erag compare") as memory:
            build(memory, self.config, self.store, given=self.spec.forest == "given")
        with replacing(_told(path)) as file:
            json.dump({"seconds": time.perf_counter() - start, "peak_mb": peak_mb()}, file)

    def missing(self) -> list[Environment]:
        """The environments without a memory built to its end."""
        return [e for e in self.environments.values() if not _told(self.path(e.name)).is_file()]

    def ask(self, items: Sequence[Any]) -> Taken:
        """The hits of each item's question, None where it has no answer; the seconds are those of whole queries."""
        start, models = time.perf_counter(), metered(self.config, self.store)
        askers = {name: Asker(self.path(name), self.config, self.store, models) for name in self.environments}
        for asker in askers.values():
            asker.warm_up("find")
        before, loading = deepcopy(models.ledger), time.perf_counter() - start
        results = [r for item in items for r in askers[item["environment"]].ask_lines([_line(item)], TOP)]
        outputs = [None if r.error else {"hits": [hit.node for hit in r.hits]} for r in results]
        return Taken.since(before, models.ledger, outputs, sum(r.seconds for r in results), loading)

    def built(self) -> Built:
        """What all its memories took."""
        told = [json.loads(_told(self.path(name)).read_text(encoding="utf-8")) for name in self.environments]
        return Built(sum(one["seconds"] for one in told), max(one["peak_mb"] for one in told))


def _line(item: Any) -> QueryLine:
    return QueryLine(0, item["asked"]["id"], item["asked"])


def _told(path: Path) -> Path:
    return path.with_suffix(".json")
