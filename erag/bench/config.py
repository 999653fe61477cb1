"""What a benchmark runs: one model a kind, chosen by `kind`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel, model_validator

from erag.lm.config import LlamaCppRoles, ModelConfig, TorchLMRoles
from erag.lm.sentence import SentenceConfig
from erag.pipeline.config import PipelineConfig
from erag.retrieve.config import FlatConfig, NodeConfig, RetrieveConfig, Share

TextEngine = Annotated[LlamaCppRoles | TorchLMRoles, Field(discriminator="kind")]
Count = Annotated[int, Field(ge=1)]


MEMORIES = Path("experiments/bench-memories")


class _Bench(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class MemoryBench(_Bench):
    """A benchmark on one memory, which is made once and kept.

    `source` is a path, or `sample` for the data that comes with the package; `forest` is `cluster`, or `given` for the
    clusters stated by the source; `memory` is where the memory is kept, one a source by default; of a file of queries
    `where` keeps only those with these keys.
    """

    source: str = "sample"
    where: dict[str, str] = {}
    forest: Literal["cluster", "given"] = "cluster"
    memory: Path | None = None
    pipeline: PipelineConfig = PipelineConfig()


class WorldsConfig(_Bench):
    """Simulated worlds below `root`, as `erag sim build` or `erag distil` writes them, of one `split`.

    Their memories are kept in `folder`, with the captions of the ground truth.
    """

    root: Path
    split: Literal["train", "dev", "test"] = "train"
    folder: Path = MEMORIES / "worlds"


class RetrievalBench(MemoryBench):
    """Retrievers compared on labelled queries.

    `queries` is a path or `sample`; `ask` says which conditions are asked beside the text; each of `retrievers` is a
    set of overrides of `pipeline.retrieve`.
    """

    kind: Literal["retrieval"]
    queries: str = "sample"
    ask: tuple[Literal["at", "sensor", "since", "until"], ...] = ()
    retrievers: dict[str, dict[str, object]]


class SelectionBench(MemoryBench):
    """Selectors compared on decisions among `cards` node texts, one of which answers a labelled query.

    Each labelled query gives `rounds` decisions: those of `queries` over `source`, or the find queries of simulated
    `worlds`. `scores` are flat retrievers that choose by their score, `selectors` models that play the select role.
    """

    kind: Literal["selection"]
    queries: str = "sample"
    worlds: WorldsConfig | None = None
    cards: Annotated[int, Field(ge=2, le=20)] = 5
    rounds: Count = 2
    seed: int = 0
    scores: dict[str, FlatConfig] = {"cosine": NodeConfig()}
    selectors: dict[str, ModelConfig]


class AnswersBench(MemoryBench):
    """`count` random queries of the files `queries`, each from a random place, answered by each of `presets`."""

    kind: Literal["answers"]
    queries: tuple[str, ...] = ("sample",)
    presets: tuple[str, ...] = ("tiny",)
    count: Count = 200
    seed: int = 0


class ThroughputBench(_Bench):
    """Tokens a second of `engines` with `sizes` prompts at once, of about `words` tokens, answers of `answer` tokens.

    They are compared with one plain llama.cpp stream of `model`.
    """

    kind: Literal["throughput"]
    model: str = "smollm2-135m"
    engines: dict[str, TextEngine]
    sizes: tuple[Count, ...] = (1, 8, 32)
    words: Annotated[int, Field(ge=8)] = 200
    answer: Annotated[int, Field(ge=2)] = 48
    repeats: Count = 3


class BuildVariant(_Bench):
    """A build to be measured: a preset with overrides, and variables of the environment for the numeric libraries."""

    preset: str = "tiny"
    overrides: tuple[str, ...] = ()
    environment: dict[str, str] = {}


class BuildBench(_Bench):
    """Builds from nothing, each in a process of its own. `folder` is where their memories are written."""

    kind: Literal["build"]
    source: str = "sample"
    forest: Literal["cluster", "given"] = "cluster"
    folder: Path = Path("experiments/bench-build")
    variants: dict[str, BuildVariant]


class ClusteringBench(_Bench):
    """Time and peak memory of clustering at several sizes, each in a process of its own."""

    kind: Literal["clustering"]
    sizes: tuple[int, ...] = (3_000, 20_000, 100_000)
    seed: int = 0


class CaptionsBench(_Bench):
    """Captioners compared with the reference captions of a source's images.

    `truth` are ground truth files of the simulator (`truth/*.jsonl`): with them objects and places are judged as well,
    an object being visible from the share `least_share` of the image on, and images without a caption of their own get
    that of the truth as reference. `synonyms` are words that mean a class of the truth. `embedder` measures SS; of
    each captioner the `worst` images are shown.
    """

    kind: Literal["captions"]
    source: Path
    reader: str = "auto"
    truth: tuple[Path, ...] = ()
    captioners: dict[str, ModelConfig]
    embedder: ModelConfig = SentenceConfig()
    synonyms: dict[str, tuple[str, ...]] = {}
    least_share: Annotated[float, Field(ge=0, le=1)] = 0.01
    samples: Count = 2000
    seed: int = 0
    worst: Annotated[int, Field(ge=0)] = 3


class AwareBench(_Bench):
    """Questions about sensors, time, change, number and the whole, on simulated worlds with captions.

    `root` is what `erag sim build --captions truth` wrote, `worlds` those that are asked (none: all); `folder` is where
    their memories are kept.
    """

    kind: Literal["aware"]
    root: Path
    worlds: tuple[str, ...] = ()
    folder: Path = MEMORIES
    pipeline: PipelineConfig = PipelineConfig()


class ScalingBench(_Bench):
    """What a query costs on generated maps of `sizes` nodes; up to `built_up_to` the builder makes the forest.

    `queries` are asked `repeats` times of each of `retrievers`, which are sets of overrides of `pipeline.retrieve`.
    The plot is written to `plot`.
    """

    kind: Literal["scaling"]
    sizes: tuple[Count, ...] = (300, 1_000, 3_000, 10_000, 30_000, 100_000, 300_000)
    built_up_to: Annotated[int, Field(ge=0)] = 30_000
    queries: Count = 12
    repeats: Count = 3
    seed: int = 0
    retrievers: dict[str, dict[str, object]]
    plot: Path = Path("experiments/bench-scaling/scaling.png")
    pipeline: PipelineConfig = PipelineConfig()


class LocationBench(_Bench):
    """How often the first hit is right and how far it is, for `weights` of location (`retrieve.alpha_rank`).

    `forms` are ways to let location count: what each changes of `retrieve`. The find queries of simulated `worlds` are
    asked from where they say, else from a node drawn by the seed. The plot is written to `plot`.
    """

    kind: Literal["location"]
    worlds: WorldsConfig
    weights: Annotated[tuple[Share, ...], Field(min_length=1)]
    forms: Annotated[dict[str, dict[str, object]], Field(min_length=1)] = {"": {}}
    seed: int = 0
    plot: Path = Path("experiments/bench-location/location.png")
    pipeline: PipelineConfig = PipelineConfig()

    @model_validator(mode="after")
    def _forms_hold(self) -> LocationBench:
        for form in self.forms:
            self.retrieve(form, self.weights[0])
        return self

    def retrieve(self, form: str, weight: float) -> RetrieveConfig:
        """How is asked in one of the forms at a weight. Raises ValueError where a form changes what there is not."""
        stated = self.pipeline.retrieve.model_dump()
        return RetrieveConfig.model_validate({**stated, **self.forms[form], "alpha_rank": weight})


AnyBench = (
    AwareBench
    | RetrievalBench
    | SelectionBench
    | AnswersBench
    | ThroughputBench
    | BuildBench
    | ClusteringBench
    | CaptionsBench
    | ScalingBench
    | LocationBench
)


class BenchConfig(RootModel[Annotated[AnyBench, Field(discriminator="kind")]]):
    """A benchmark's configuration file."""

    model_config = ConfigDict(frozen=True)
