"""What a benchmark runs: one model a kind, chosen by `kind`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel

from erag.pipeline.config import PipelineConfig


class RetrievalBench(BaseModel):
    """Retrievers compared on labelled queries over one memory.

    `source` and `queries` are paths, or `sample` for the data that comes with the package; `where` keeps only queries
    with these keys; `ask` says which conditions are asked beside the text; `forest` is `cluster`, or `given` for the
    clusters stated by the source; `memory` is where the memory is kept, one a source by default; each of `retrievers`
    is a set of overrides of `pipeline.retrieve`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["retrieval"]
    source: str = "sample"
    queries: str = "sample"
    where: dict[str, str] = {}
    ask: tuple[Literal["at", "sensor", "since", "until"], ...] = ()
    forest: Literal["cluster", "given"] = "cluster"
    memory: Path | None = None
    pipeline: PipelineConfig = PipelineConfig()
    retrievers: dict[str, dict[str, object]]


class ClusteringBench(BaseModel):
    """Time and peak memory of clustering at several sizes, each in a process of its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["clustering"]
    sizes: tuple[int, ...] = (3_000, 20_000, 100_000)
    seed: int = 0


class BenchConfig(RootModel[Annotated[RetrievalBench | ClusteringBench, Field(discriminator="kind")]]):
    """A benchmark's configuration file."""

    model_config = ConfigDict(frozen=True)
