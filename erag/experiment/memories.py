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
class Made:
    """A built memory: its file, the key of all it was built from, and what building it took."""

    path: Path
    key: str
    cost: Mapping[str, float]


def building(config: PipelineConfig) -> PipelineConfig:
    """The part of a configuration that a memory depends on; systems that agree in it share their memories."""
    roles = {role: name for role, name in config.backend.roles.items() if role in BUILDING}
    models = {name: config.backend.models[name] for name in sorted(set(roles.values()))}
    backend = BackendConfig(models=models, roles=roles)
    return PipelineConfig(backend=backend, map=config.map, forest=config.forest, summaries=config.summaries)


def memory(
    source: Source, config: PipelineConfig, given: bool, work: Path, store: ModelStore, progress: Progress
) -> Made:
    """The memory of a source, made when it is not there; what was begun by a killed run is gone on with."""
    reduced = building(config)
    models = [store.fingerprint(m.model) for m in reduced.backend.models.values() if hasattr(m, "model")]
    dumped = reduced.model_dump_json()
    key = content_hash(source.digest, dumped, str(given), str(BUILD_VERSION), *models).hex()
    path = work / "memories" / f"{source.environment.name}-{key[:12]}.erag"
    told = path.with_suffix(".json")
    if not told.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        ingest(source.folder, path)
        with MemoryFile.writing(path, "erag run") as opened:
            report = build(opened, reduced, store, given=given, progress=progress)
        with replacing(told) as file:
            json.dump(build_cost(report.ledger, report.seconds), file, sort_keys=True)
    return Made(path, key, json.loads(told.read_text(encoding="utf-8")))
