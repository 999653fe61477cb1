"""Retrievers compared on the same memory and the same labelled queries."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from erag.bench.config import MEMORIES, MemoryBench, RetrievalBench
from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.labelled import KindScore, evaluate
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.pipeline.build import build
from erag.pipeline.config import validate
from erag.pipeline.ingest import ingest
from erag.pipeline.query import Asker
from erag.retrieve.config import RetrieveConfig


def run(config: RetrievalBench, store: ModelStore, progress: Progress = quiet) -> Iterator[tuple[str, KindScore]]:
    """The score of each retriever on each kind of query."""
    kept = built(config, store, progress)
    for name, overrides in config.retrievers.items():
        retrieve = validate(
            RetrieveConfig, {**config.pipeline.retrieve.model_dump(), **overrides}, f"retrievers.{name}"
        )
        asker = Asker(kept, config.pipeline.model_copy(update={"retrieve": retrieve}), store)
        for score in evaluate(asker, query_file(config.queries), config.where, parts=config.ask):
            yield name, score


def built(config: MemoryBench, store: ModelStore, progress: Progress = quiet) -> Path:
    """The memory of a benchmark; it is made when it is absent or out of date."""
    source = source_folder(config.source)
    kept = config.memory or MEMORIES / f"{'-'.join(source.resolve().parts[-2:])}.erag"
    kept.parent.mkdir(parents=True, exist_ok=True)
    ingest(source, kept)
    with MemoryFile.writing(kept, "erag bench") as memory:
        _check_alone(memory)
        build(memory, config.pipeline, store, given=config.forest == "given", progress=progress)
    return kept


def source_folder(source: str) -> Path:
    """A source of observations by path, or that of the package."""
    return sample_dir() if source == "sample" else Path(source)


def query_file(queries: str) -> Path:
    """A file of queries by path, or that of the package."""
    return sample_queries() if queries == "sample" else Path(queries)


def _check_alone(memory: MemoryFile) -> None:
    sources = sorted(memory.observations.sources())
    if len(sources) > 1:
        raise InputError(
            f"holds {' and '.join(sources)}",
            where=str(memory.path),
            allowed="one source",
            repair="--set memory=NEW.erag",
        )
