"""Whole builds in fresh processes: seconds by stage, memory, calls and tokens, and how good the summaries are."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from erag.bench.config import BuildBench, BuildVariant
from erag.bench.memory import peak_mb


@dataclass(frozen=True, slots=True)
class BuildScore:
    """One build from nothing: `seconds` by stage, ingest and all; `again` is the second build of the same memory."""

    variant: str
    seconds: Mapping[str, float]
    again: float
    peak_mb: float
    clusters: int
    tokens_read: int
    tokens_written: int
    composed: int
    quality: tuple[str, ...]

    @property
    def total(self) -> float:
        return sum(self.seconds.values())


def run(config: BuildBench, folder: Path) -> Iterator[BuildScore]:
    """One score a variant, in the order of the configuration; memories are written into `folder` and overwritten."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, variant in config.variants.items():
        path = folder / f"{name.replace(' ', '-')}.erag"
        path.unlink(missing_ok=True)
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            yield pool.submit(_build, name, config, variant, path).result()


def _build(name: str, config: BuildBench, variant: BuildVariant, path: Path) -> BuildScore:
    os.environ.update(variant.environment)  # read by the numeric libraries, which are not imported yet
    from erag.bench.retrieval import source_folder
    from erag.lm.weights import default_store
    from erag.memory.file import MemoryFile
    from erag.pipeline.build import build
    from erag.pipeline.config import load_config
    from erag.pipeline.ingest import ingest

    start = time.perf_counter()
    ingest(source_folder(config.source), path)
    ingested = time.perf_counter() - start
    settings, store = load_config(variant.preset, None, variant.overrides), default_store()
    given = config.forest == "given"
    with MemoryFile.writing(path, "erag bench") as memory:
        report = build(memory, settings, store, given=given)
        start = time.perf_counter()
        build(memory, settings, store, given=given)
        again = time.perf_counter() - start
        generation = memory.generations.load()
    ledger = report.ledger
    return BuildScore(
        name,
        {"ingest": ingested, **report.seconds},
        again,
        peak_mb(),
        len(generation.clusters) if generation else 0,
        sum(ledger.tokens_in.values()),
        sum(ledger.tokens_out.values()),
        ledger.events["summaries composed from facts"],
        tuple(line.strip() for line in report.lines if line.startswith("  level")),
    )
