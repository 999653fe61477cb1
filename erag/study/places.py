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


def summarised(config: Places, store: ModelStore, progress: Progress = quiet) -> list[Path]:
    """Memories of the worlds, every cluster of which the teacher has summarised; what is there already is kept.

    Raises ConfigError where the simulator is not installed or knows no such world.
    """
    pipeline = _pipeline(config)
    key = content_hash(build_backend(pipeline.backend, store).fingerprint("summarise")).hex()[:12]
    memories: list[Path] = []
    for seed in config.seeds:
        worlds = config.folder / f"worlds-{seed}"
        if not all((worlds / "truth" / f"{name}.jsonl").is_file() for name in config.worlds):
            render(worlds, config.worlds, seed, progress, objects=False, captions="truth", size=config.pixels)
        for name in config.worlds:
            progress("worlds summarised", len(memories), len(config.worlds) * len(config.seeds))
            memory = config.folder / f"{key}-{seed}" / f"{name}.erag"
            source = str(worlds / "worlds" / name)
            built(MemoryBench(source=source, memory=memory, pipeline=pipeline), store, progress)
            memories.append(memory)
    progress("worlds summarised", len(memories), len(memories))
    return memories


def _pipeline(config: Places) -> PipelineConfig:
    """The preset `tiny`, its summaries by the teacher."""
    base = load_config("tiny")
    models = {**base.backend.models, _TEACHER: config.teacher}
    roles = {**base.backend.roles, "summarise": _TEACHER}
    return base.model_copy(update={"backend": base.backend.model_copy(update={"models": models, "roles": roles})})
