"""What `erag compare` runs: backends, trials by role, and what is asked how often."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from erag.forest.summaries import SummaryConfig
from erag.generate.config import AnswerConfig
from erag.lm.config import ModelConfig
from erag.lm.roles import RoleName
from erag.lm.sentence import SentenceConfig

Count = Annotated[int, Field(ge=1)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class BackendSpec(_Part):
    """A model to be compared. `cosine` lets an embedder select and score by the cosine of its vectors."""

    model: ModelConfig
    cosine: bool = False


class _Trial(_Part):
    """`count` items drawn with `seed` are asked of each of `backends`; `cloud` names the model whose records exist."""

    backends: tuple[str, ...] = Field(min_length=1)
    count: Count = 40
    seed: int = 0


class ObjectsTrial(_Trial):
    """Captioners on simulated worlds (rendered where they are missing): objects said against objects in view."""

    kind: Literal["objects"]
    worlds: Path = Path("experiments/compare/worlds")
    names: tuple[str, ...] = ("campus", "office")
    render_seed: int = 0
    least_share: float = Field(0.01, gt=0, lt=1, description="of the image; from here on an object counts as visible")
    synonyms: dict[str, tuple[str, ...]] = Field({}, description="class -> other words that name it")


class CaptionsTrial(_Trial):
    """Captioners on real frames that a cloud model captioned: SS to its captions."""

    kind: Literal["captions"]
    source: Path
    cloud: str = "GPT-4o-mini"


class SummariesTrial(_Trial):
    """Summarisers on the clusters of a forest whose summaries a cloud model wrote: the same clusters, the same members.

    `summaries` says what a summariser is given and what is kept of its answer, as in a build.
    """

    kind: Literal["summaries"]
    source: Path
    cloud: str = "GPT-4"
    summaries: SummaryConfig = SummaryConfig(keep=False)


class DecisionsTrial(_Trial):
    """Selectors on choices a cloud model made. Only part `part` of `folds` is asked, split `by` question or card set.

    Students that were taught with the other parts are judged without a leak.
    """

    kind: Literal["decisions"]
    source: Path
    cloud: str = "cloud teacher"
    folds: Annotated[int, Field(ge=1, le=20)] = 5
    part: Annotated[int, Field(ge=0)] = 0
    by: Literal["question", "cards"] = "question"

    @model_validator(mode="after")
    def _there(self) -> Self:
        if self.part >= self.folds:
            raise ValueError(f"part {self.part} of {self.folds} folds: they count from 0")
        return self


class _Labelled(_Trial):
    """Texts of a source and labelled queries about them; both by path, or `sample` for those of the package."""

    source: str = "sample"
    queries: str = "sample"
    where: dict[str, str] = {}


class RelevanceTrial(_Labelled):
    """Scorers on labels: `relevant` texts that answer a query, and `others` that do not, by the area under the ROC."""

    kind: Literal["relevance"]
    relevant: Count = 2
    others: Count = 6


class SearchTrial(_Labelled):
    """Embedders on labels: each query among all texts of the source, or among `pool` of them."""

    kind: Literal["search"]
    pool: Annotated[int, Field(ge=10)] | None = None


class AnswersTrial(_Labelled):
    """Generators on global questions with golden answers, from the same views and counts for all."""

    kind: Literal["answers"]
    answer: AnswerConfig = AnswerConfig()


AnyTrial = Annotated[
    ObjectsTrial | CaptionsTrial | SummariesTrial | DecisionsTrial | RelevanceTrial | SearchTrial | AnswersTrial,
    Field(discriminator="kind"),
]
ROLE_OF: dict[str, RoleName] = {
    "objects": "caption", "captions": "caption", "summaries": "summarise", "decisions": "select",
    "relevance": "score", "search": "embed", "answers": "generate",
}  # fmt: skip


class CompareConfig(_Part):
    """A comparison. `judge` is the embedder by which texts are held against each other; results go to `out`.

    `threads` are those of a measured process; `budgets` the memories (GiB) for which a verdict is given.
    """

    out: Path = Path("experiments/compare/run")
    backends: dict[str, BackendSpec] = Field(min_length=1)
    trials: dict[str, AnyTrial] = Field(min_length=1)
    judge: ModelConfig = SentenceConfig()
    threads: Annotated[int, Field(ge=1, le=1024)] | None = None
    budgets: tuple[Annotated[float, Field(gt=0)], ...] = (1, 2, 4, 8)

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name, trial in self.trials.items():
            if unknown := sorted(set(trial.backends) - set(self.backends)):
                raise ValueError(f"trial {name!r} names {unknown[0]!r}, which is no backend")
        return self
