"""What `erag distil` runs for adapters of a language model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from erag.forest.summaries import SummaryConfig
from erag.lm.adapter import EmbedderConfig
from erag.lm.config import ModelConfig
from erag.lm.llamacpp.config import Format
from erag.lm.probe import DtypeWish
from erag.lm.sentence import SentenceConfig
from erag.study.decisions import DecisionSource
from erag.study.textconfig import Wishing


class _Config(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NamingTask(Wishing):
    """Query understanding: the wishes, teacher and lessons of the student `understanding`, with the same splits.

    What that student names (by its `ridge`, `blend` and `prior`) is judged beside.
    """

    kind: Literal["understanding"]


class ChoosingTask(_Config):
    """Choices among cards: of each card whether it is the one, asked as the selector `yes_no` asks it."""

    kind: Literal["select"]
    decisions: tuple[DecisionSource, ...] = Field(min_length=1)
    split: Literal["questions", "sets"] = "questions"


Pixels = Annotated[int, Field(ge=32, le=2048)]


class Places(_Config):
    """Simulated worlds with true captions, rendered where they are missing, whose clusters `teacher` summarises.

    Only words are wanted of them, so that their images may be small (`pixels`, width and height). Each world is
    furnished by each of `seeds`; however furnished it is one place.
    """

    teacher: ModelConfig
    worlds: tuple[str, ...] = Field(min_length=1)
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = Field((0,), min_length=1)
    pixels: tuple[Pixels, Pixels] = (160, 120)
    folder: Path = Path("experiments/distil/summaries")

    @model_validator(mode="after")
    def _distinct(self) -> Places:
        for name, values in (("worlds", self.worlds), ("seeds", self.seeds)):
            if len(set(values)) < len(values):
                raise ValueError(f"{name} {values}: one stands there twice")
        return self


class TellingTask(_Config):
    """Summaries of clusters, as memory files have recorded and accepted them, whoever answered.

    The memories are those of `memories`, built with the settings `summaries`, and of `places`. Each file of `memories`
    is a place, as is each world; places are left out whole.
    """

    kind: Literal["summarise"]
    memories: tuple[Path, ...] = ()
    places: Places | None = None
    summaries: SummaryConfig = SummaryConfig()
    embedder: EmbedderConfig = SentenceConfig(dtype="float32")
    vectors: Path = Field(Path("experiments/distil/summaries/vectors"), description="where vectors of texts are kept")

    @model_validator(mode="after")
    def _taught(self) -> TellingTask:
        if len({path.resolve() for path in self.memories}) + len(self.places.worlds if self.places else ()) < 2:
            raise ValueError("fewer than two places: name two of `memories`, or two of the worlds of `places`")
        return self


LoraTask = Annotated[NamingTask | ChoosingTask | TellingTask, Field(discriminator="kind")]


class LoraTraining(_Config):
    """How an adapter is trained; the same numbers come out of a run that was killed and resumed."""

    epochs: int = Field(4, ge=1, le=100)
    batch_size: int = Field(16, ge=1, le=1024)
    rate: float = Field(1e-3, gt=0, le=1, description="highest learning rate; warm-up and cosine around it")
    decay: float = Field(0.01, ge=0, le=1, description="weight decay of the factors")
    seed: int = 0
    wandb: bool = True
    threads: int | None = Field(None, ge=1, le=1024)
    dtype: DtypeWish = "auto"


class LoraDistil(_Config):
    """A low-rank adapter on the projections of a small language model, taught what a larger one answers.

    Items are dealt into `folds` by their groups; the first `judged` folds are each left out of a training of their own
    and answered by what came of it, merged with the base and written in each of `forms`. What is written to `out` may
    have been taught any item.
    """

    kind: Literal["lora"]
    base: str = "smollm2-135m"
    task: LoraTask
    taught_by: str = Field(max_length=500, description="the teacher, and what follows for the use of the weights")
    rank: int = Field(8, ge=1, le=256)
    alpha: float = Field(16.0, gt=0, allow_inf_nan=False)
    most: int | None = Field(None, ge=2, description="items that are taught, evenly among those that may be")
    folds: int = Field(5, ge=2, le=20)
    judged: int = Field(5, ge=1, le=20)
    forms: tuple[Format, ...] = Field(("f16",), min_length=1)
    work: Path = Path("experiments/distil/lora")
    out: Path
    training: LoraTraining = LoraTraining()
    resamples: int = Field(2000, ge=10, description="of the bootstrap over groups")

    @model_validator(mode="after")
    def _fits(self) -> LoraDistil:
        if self.judged > self.folds:
            raise ValueError(f"{self.judged} folds judged of {self.folds}")
        return self
