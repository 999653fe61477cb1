"""The memories of an experiment: built once for each content and configuration, whoever asks them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from erag.core.output import replacing
from erag.core.progress import Progress
from erag.core.text import content_hash
from erag.evaluate.cost import build_cost
from erag.experiment.sources import Source
from erag.lm.config import BackendConfig
from erag.lm.roles import RoleName
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.pipeline.build import BUILD_VERSION, build
from erag.pipeline.config import PipelineConfig
from erag.pipeline.ingest import ingest

BUILDING: tuple[RoleName, ...] = ("embed", "summarise")  # the roles a build calls


@dataclass(frozen=True)
class Memory:
    """The memory of a source under a configuration: its file, the key of all it is built from, and whether it is there.

    Systems whose configurations agree in what a memory depends on share it, and so do experiments of one work folder.
    """

    source: Source
    config: PipelineConfig
    given: bool
    path: Path
    key: str

    @classmethod
    def of(cls, source: Source, config: PipelineConfig, given: bool, work: Path, store: ModelStore) -> Memory:
        """Nothing is built yet."""
        reduced = building(config)
        models = [store.fingerprint(m.model) for m in reduced.backend.models.values() if hasattr(m, "model")]
        key = content_hash(source.digest, reduced.model_dump_json(), str(given), str(BUILD_VERSION), *models).hex()
        path = work / "memories" / f"{source.environment.name}-{key[:12]}.erag"
        return cls(source, reduced, given, path, key)

    @property
    def made(self) -> bool:
        """Whether it was built to its end."""
        return self._told.is_file()

    @property
    def cost(self) -> Mapping[str, float]:
        """What building it took; nothing where it was not built."""
        return json.loads(self._told.read_text(encoding="utf-8")) if self.made else {}

    def make(self, store: ModelStore, progress: Progress) -> None:
        """Build it where it is not there; what was begun by a killed run is gone on with."""
        if self.made:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        ingest(self.source.folder, self.path)
        with MemoryFile.writing(self.path, "erag run") as opened:
            report = build(opened, self.config, store, given=self.given, progress=progress)
        with replacing(self._told) as file:
            json.dump(build_cost(report.ledger, report.seconds), file, sort_keys=True)

    @property
    def _told(self) -> Path:
        return self.path.with_suffix(".json")


def building(config: PipelineConfig) -> PipelineConfig:
    """The part of a configuration that a memory depends on; systems that agree in it share their memories."""
    roles = {role: name for role, name in config.backend.roles.items() if role in BUILDING}
    models = {name: config.backend.models[name] for name in sorted(set(roles.values()))}
    backend = BackendConfig(models=models, roles=roles)
    return PipelineConfig(backend=backend, map=config.map, forest=config.forest, summaries=config.summaries)
