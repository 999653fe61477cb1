"""What `erag compare` runs: backends and whole systems, trials by role, and what is asked how often."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from erag.forest.summaries import SummaryConfig
from erag.generate.config import AnswerConfig
from erag.lm.config import ModelConfig
from erag.lm.roles import RoleName
from erag.lm.sentence import SentenceConfig
from erag.study.compact import VectorForm
from erag.study.decisions import Part

Count = Annotated[int, Field(ge=1)]
Role = RoleName | Literal["all"]  # of a trial; "all": a whole system is asked
Texts = Annotated[tuple[str, ...], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class BackendSpec(_Part):
    """A model to be compared.

    `cosine` lets an embedder select and score by the cosine of its vectors; `vectors` is how those of texts are kept
    when they are searched.
    """

    model: ModelConfig
    cosine: bool = False
    vectors: VectorForm = "float32"


class SystemSpec(_Part):
    """A whole system to be compared: a preset with overrides (`path=value`), over its own forest or the `given` one."""

    preset: str = "tiny"
    overrides: Texts = ()
    forest: Literal["cluster", "given"] = "cluster"


class WorldsConfig(_Part):
    """Simulated worlds that no student was taught with, rendered into `folder` where they are missing."""

    folder: Path = Path("experiments/compare/worlds")
    names: tuple[str, ...] = ("campus", "apartment")
    seed: int = 0


class _Trial(_Part):
    """At most `count` items, drawn with `seed`."""

    count: Count = 40
    seed: int = 0


class _RoleTrial(_Trial):
    """The items are asked of each of `backends`."""

    backends: tuple[str, ...] = Field(min_length=1)


class ObjectsTrial(_RoleTrial):
    """Captioners on the simulated worlds: objects said against objects in view."""

    kind: Literal["objects"]
    least_share: float = Field(0.01, gt=0, lt=1, description="of the image; from here on an object counts as visible")
    synonyms: dict[str, tuple[str, ...]] = Field({}, description="class -> other words that name it")


class CaptionsTrial(_RoleTrial):
    """Captioners on real frames that the model `cloud` captioned: SS to its captions."""

    kind: Literal["captions"]
    source: Path
    cloud: str = "GPT-4o-mini"


class SummariesTrial(_RoleTrial):
    """Summarisers on the clusters of a forest that the model `cloud` summarised: the same clusters, the same members.

    `summaries` says what a summariser is given and what is kept of its answer, as in a build.
    """

    kind: Literal["summaries"]
    source: Path
    cloud: str = "GPT-4"
    summaries: SummaryConfig = SummaryConfig(keep=False)


class DecisionsTrial(_RoleTrial):
    """Selectors on choices that the model `cloud` made; only those of `part` are asked.

    Students that were taught without it are judged without a leak.
    """

    kind: Literal["decisions"]
    source: Path
    cloud: str = "cloud teacher"
    part: Part = Part()


class _Labelled(_RoleTrial):
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


class MemoriesTrial(_Trial):
    """End to end: each of `systems` builds memories of a data set's environments and is asked labelled questions.

    `dataset` is a loader of `erag.evaluate.datasets`; `simulated` without `root` are the comparison's `worlds`. `where`
    chooses among the questions by their keys. The memory of `reference` holds what the model `cloud` said, and the
    others are held against its hits; with no `cloud` it holds the truth and shows what is left to lose. `given` is a
    file of the same nodes that states the forest, where the data set itself does not.
    """

    kind: Literal["memories"]
    dataset: str = "simulated"
    root: Path | None = None
    queries: Path | None = None
    where: dict[str, Texts] = {}
    systems: tuple[str, ...] = Field(min_length=1)
    reference: str | None = None
    cloud: str = ""
    given: Path | None = None

    @model_validator(mode="after")
    def _held(self) -> Self:
        if self.cloud and self.reference is None:
            raise ValueError(f"what {self.cloud} said has to be in the memory of a reference")
        return self


RoleTrialConfig = (
    ObjectsTrial | CaptionsTrial | SummariesTrial | DecisionsTrial | RelevanceTrial | SearchTrial | AnswersTrial
)
AnyTrial = Annotated[RoleTrialConfig | MemoriesTrial, Field(discriminator="kind")]
ROLE_OF: dict[str, RoleName] = {
    "objects": "caption", "captions": "caption", "summaries": "summarise", "decisions": "select",
    "relevance": "score", "search": "embed", "answers": "generate",
}  # fmt: skip


class CompareConfig(_Part):
    """A comparison. `judge` is the embedder by which texts are held against each other; results go to `out`.

    `threads` are those of a measured process; `budgets` the memories (GiB) for which a verdict is given.
    """

    out: Path = Path("experiments/compare/run")
    backends: dict[str, BackendSpec] = {}
    systems: dict[str, SystemSpec] = {}
    worlds: WorldsConfig = WorldsConfig()
    trials: dict[str, AnyTrial] = Field(min_length=1)
    judge: ModelConfig = SentenceConfig()
    threads: Annotated[int, Field(ge=1, le=1024)] | None = None
    budgets: tuple[Annotated[float, Field(gt=0)], ...] = (1, 2, 4, 8)

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name, trial in self.trials.items():
            if isinstance(trial, MemoriesTrial):
                asked = (*trial.systems, *((trial.reference,) if trial.reference else ()))
                _there(name, asked, self.systems, "system")
            else:
                _there(name, trial.backends, self.backends, "backend")
        return self


def _there(
    trial: str, asked: tuple[str, ...], known: dict[str, BackendSpec] | dict[str, SystemSpec], what: str
) -> None:
    if unknown := sorted(set(asked) - set(known)):
        raise ValueError(f"trial {trial!r} names {unknown[0]!r}, which is no {what}")
