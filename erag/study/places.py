"""Places whose clusters a teacher summarises: simulated worlds as memories, in the words of the ground truth."""

from __future__ import annotations

from pathlib import Path

from erag.bench.config import MemoryBench
from erag.bench.retrieval import built
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm.config import build_backend
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig, load_config
from erag.study.loraconfig import Places
from erag.study.worlds import render

_TEACHER = "teacher"


def summarised(config: Places, store: ModelStore, progress: Progress = quiet) -> dict[Path, str]:
    """Memories of the worlds, with their places, every cluster of which the teacher has summarised.

    What is there already is kept; however a world is furnished it is the same place. Raises ConfigError where the
    simulator is not installed or knows no such world.
    """
    pipeline = _pipeline(config)
    teacher = content_hash(build_backend(pipeline.backend, store).fingerprint("summarise")).hex()[:12]
    total = len(config.worlds) * len(config.seeds)
    memories: dict[Path, str] = {}
    for seed in config.seeds:
        folder = config.folder / "-".join(map(str, (seed, *config.pixels)))
        render(folder, config.worlds, seed, progress, objects=False, captions="truth", size=config.pixels)
        for name in config.worlds:
            progress("worlds summarised", len(memories), total)
            memory = folder / teacher / f"{name}.erag"
            built(MemoryBench(source=str(folder / "worlds" / name), memory=memory, pipeline=pipeline), store, progress)
            memories[memory] = name
    progress("worlds summarised", total, total)
    return memories


def _pipeline(config: Places) -> PipelineConfig:
    """The preset `tiny`, its summaries by the teacher."""
    base = load_config("tiny")
    models = {**base.backend.models, _TEACHER: config.teacher}
    roles = {**base.backend.roles, "summarise": _TEACHER}
    return base.model_copy(update={"backend": base.backend.model_copy(update={"models": models, "roles": roles})})
