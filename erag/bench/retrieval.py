"""Retrievers compared on the same memory and the same labelled queries."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from erag.bench.config import RetrievalBench
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

MEMORIES = Path("experiments/bench-retrieval")


def run(config: RetrievalBench, store: ModelStore, progress: Progress = quiet) -> Iterator[tuple[str, KindScore]]:
    """The score of each retriever on each kind of query. The memory is made once and kept."""
    source = sample_dir() if config.source == "sample" else Path(config.source)
    queries = sample_queries() if config.queries == "sample" else Path(config.queries)
    kept = config.memory or MEMORIES / f"{'-'.join(source.resolve().parts[-2:])}.erag"
    kept.parent.mkdir(parents=True, exist_ok=True)
    ingest(source, kept)
    with MemoryFile.writing(kept, "erag bench") as memory:
        _check_alone(memory)
        build(memory, config.pipeline, store, given=config.forest == "given", progress=progress)
    for name, overrides in config.retrievers.items():
        retrieve = validate(
            RetrieveConfig, {**config.pipeline.retrieve.model_dump(), **overrides}, f"retrievers.{name}"
        )
        asker = Asker(kept, config.pipeline.model_copy(update={"retrieve": retrieve}), store)
        for score in evaluate(asker, queries, config.where, parts=config.ask):
            yield name, score


def _check_alone(memory: MemoryFile) -> None:
    sources = sorted(memory.observations.sources())
    if len(sources) > 1:
        raise InputError(
            f"holds {' and '.join(sources)}",
            where=str(memory.path),
            allowed="one source",
            repair="--set memory=NEW.erag",
        )
