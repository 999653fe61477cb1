"""What `erag run` runs: data, questions, systems, judges, and the tables made of the answers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from erag.evaluate.baselines.naive import NaiveConfig
from erag.evaluate.navigation.planner import FollowerConfig
from erag.lm.config import ModelConfig, WriterConfig

Mode = Literal["Q", "Q,L", "Q,S", "Q,L,S", "L", "L,S"]
PARTS = {"Q": "query", "L": "at", "S": "sensor"}  # what a letter of a mode is in a line of Q.jsonl
Count = Annotated[int, Field(ge=1)]
Metric = Annotated[str, Field(min_length=1, max_length=60)]
RELEVANCE = "relevance"  # our model of relevance as one of the models that judges and systems may share


class _Config(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


Values = Annotated[tuple[str, ...], BeforeValidator(_listed)]  # one text or several


class DataConfig(_Config):
    """A data set, which of its environments and questions, and what the memory is given of them.

    `dataset` is a loader of `erag.evaluate.datasets`; `split` and `environments` choose among its environments, `where`
    among its questions by their keys. `captions`: those `given`, the `truth`'s, or those of a captioner. Object nodes
    name what is there: they are left out unless `objects`; `readings` says whether the memory has sensor readings
    (E-multimodal) or not (E-image). `questions_per_set` draws a seeded sample of the questions of each set and
    environment.
    """

    dataset: str
    root: Path | None = None
    queries: Path | None = None
    split: str | None = None
    environments: tuple[str, ...] = ()
    where: dict[str, Values] = {}
    captions: Literal["given", "truth"] | ModelConfig = "given"
    objects: bool = False
    readings: bool = True
    forest: Literal["cluster", "given"] = "cluster"
    questions_per_set: Count | None = None


class SetConfig(_Config):
    """A set of questions: those whose keys have one of the values of `where`, and the modes they are asked in.

    A mode names what is asked: the text Q, the location L, the wish for readings S. A question that states no location
    gets that of a node drawn by the seed; one without a wish gets `sensor`, or is not asked in a mode with S. The time
    window belongs to the question and is always asked.
    """

    where: dict[str, Values] = {}
    modes: tuple[Mode, ...] = ("Q",)
    sensor: dict[str, Literal["low", "high"] | tuple[float, float]] | None = None


class SystemConfig(_Config):
    """A system that is asked: a preset with overrides, or Naive-RAG.

    `queries`: asked only a sample of that many questions of each set, drawn by the seed and spread over environments.
    `data`, `environments` and `sets` restrict what it is asked. A `plain` one answers whatever it finds, in the order
    of its scores, as the systems of other papers do: without our thresholds and our spreading over places. `flat` marks
    the baselines of which the best is what others are tested against; `ours` the systems that are this project's, the
    first of them the default; `stands_for` says which of the paper's systems it is the counterpart of.
    """

    preset: str = "tiny"
    overrides: Values = ()
    naive: NaiveConfig | None = None
    queries: Count | None = None
    data: Values = ()
    environments: Values = ()
    sets: Values = ()
    plain: bool = False
    flat: bool = False
    ours: bool = False
    stands_for: str = ""
    note: str = ""


class ColumnConfig(_Config):
    """A column of a table: the mean of a metric over a set of questions asked in one mode.

    With `stated` only questions that state a wish for readings themselves count. `better` says whether `more` or `less`
    is, where the metric alone does not (refusals of what nothing answers). `printed` are the paper's figures by the
    name of its system.
    """

    title: str
    set: str
    metric: Metric
    mode: Mode = "Q"
    stated: bool = False
    better: Literal["more", "less"] | None = None
    printed: dict[str, float] = {}


class TableConfig(_Config):
    """A table: a row a system. `data` restricts it to some data sets; one table is made for each data set.

    Systems are tested against the best flat baseline of each column, or `against` one system.
    """

    title: str
    columns: tuple[ColumnConfig, ...]
    systems: Values = ()
    data: Values = ()
    against: str = ""


JudgeKind = Literal["labels", "words", "embedding", "relevance", "model"]


class JudgeConfig(_Config):
    """A judge: object `labels`, `words`, an `embedding`, our model of `relevance`, or a language `model`.

    `each`: it is shown every listed object on its own, as it looks (`objects`) or by its class alone (`classes`), and
    the best one counts. `expanded`: it is asked, too, by what would satisfy the question: the stated `targets`, or what
    the panel's expander names from the question alone (`model`). How a model judges is the `scorer` of its `text`
    section: Yes or No, or by likelihood.
    """

    kind: JudgeKind
    model: WriterConfig | None = None
    each: Literal["objects", "classes"] | None = None
    expanded: Literal["targets", "model"] | None = None

    @model_validator(mode="after")
    def _fits(self) -> JudgeConfig:
        if (self.kind == "model") != (self.model is not None):
            raise ValueError("a judge of the kind model, and no other, needs a model")
        return self


class AgreementConfig(_Config):
    """On what the panel is tried before it is used: labelled pairs of `questions` questions of each set and data set.

    Of each the `top` nodes of a ranking by the retriever `ranking`, and `others` drawn by the seed.
    """

    questions: Count = 20
    top: Count = 50
    others: Annotated[int, Field(ge=0)] = 50
    ranking: Literal["node", "sentence", "bm25", "fusion"] = "fusion"


class PanelConfig(_Config):
    """The judges by name. P(Q|A) is the `mean` of their votes, or what the fitted `stack` makes of them.

    `reads`: the object `lists` of the world wherever there are any, apart from every caption, or `all` that is known.
    `expander` names what would satisfy a question, for the judges that are `expanded`; only questions of the kinds
    `expand_kinds` are. `fit` writes a stack fitted on the labelled pairs of this experiment: on worlds for training.
    """

    judges: dict[str, JudgeConfig] = {"words": JudgeConfig(kind="words"), "labels": JudgeConfig(kind="labels")}
    reads: Literal["lists", "all"] = "all"
    expander: WriterConfig | None = None
    expand_kinds: Values = ("implicit",)
    stack: Path | None = None
    probability: Literal["mean", "stack"] = "mean"
    fit: bool = False
    agreement: AgreementConfig | None = AgreementConfig()

    def models(self, name: str, similarity: str) -> frozenset[str]:
        """The weights a judge rests on; `similarity` are those of the experiment's embedder."""
        judge = self.judges[name]
        named = {similarity} if judge.kind in ("embedding", "relevance") else set[str]()
        named |= {RELEVANCE} if judge.kind == "relevance" else set()
        asked = (judge.model, self.expander if judge.expanded == "model" else None)
        return frozenset(named | {model_name(model) for model in asked if model is not None})

    @model_validator(mode="after")
    def _fits(self) -> PanelConfig:
        asked = [name for name, judge in self.judges.items() if judge.expanded == "model"]
        if asked and self.expander is None:
            raise ValueError(f"the judge {asked[0]!r} is expanded by a model and there is no expander")
        if self.probability == "stack" and self.stack is None:
            raise ValueError("probability: stack needs the file of a stack")
        if not self.judges:
            raise ValueError("a panel needs a judge")
        return self


class AxisConfig(_Config):
    """A parameter that is swept: its path in the pipeline's configuration and its values."""

    path: str
    values: tuple[float | int | str, ...]


class SweepConfig(_Config):
    """Systems made by setting parameters of `base`: every value of each axis, or with `grid` every combination.

    `plots` are the columns whose means are drawn over each axis.
    """

    base: SystemConfig = SystemConfig()
    axes: dict[str, AxisConfig]
    grid: tuple[tuple[str, str], ...] = ()


class TripsConfig(_Config):
    """A simulated robot that drives from L to the first answer: its `planner`, and what it meets.

    `blocked` is the share of edges that are blocked without the map's knowing, `success_m` how near is there.
    """

    planner: FollowerConfig = FollowerConfig()
    blocked: Annotated[float, Field(ge=0, le=1)] = 0.02
    success_m: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 3.0


class ExperimentConfig(_Config):
    """An experiment. `work` keeps what can be made again: sources, memories, recorded calls of judges.

    `overrides` hold for every system, before its own. `intervals`: over `queries`, or over whole `environments`, which
    are what is independent. `similarity` names the embedder of SS, which retrieved nothing where it is not that of the
    systems. `top` answers a question are kept. With `trips` a robot drives to the first answer of questions with L.
    """

    title: str
    notes: tuple[str, ...] = ()
    seed: int = 0
    work: Path = Path("experiments/work")
    top: Annotated[int, Field(ge=5, le=100)] = 5
    data: dict[str, DataConfig]
    sets: dict[str, SetConfig]
    overrides: Values = ()
    systems: dict[str, SystemConfig] = {}
    sweep: SweepConfig | None = None
    panel: PanelConfig = PanelConfig()
    trips: TripsConfig | None = None
    tables: tuple[TableConfig, ...] = ()
    capabilities: bool = False
    pictures: bool = True
    intervals: Literal["queries", "environments"] = "queries"
    similarity: str = "minilm-l6"

    @model_validator(mode="after")
    def _names(self) -> ExperimentConfig:
        for table in self.tables:
            _known("data", table.data, self.data)
            _known("sets", [c.set for c in table.columns], self.sets)
            if not self.sweep:
                _known("systems", (*table.systems, *filter(None, [table.against])), self.systems)
        for column in (c for t in self.tables for c in t.columns):
            if column.mode not in self.sets[column.set].modes:
                raise ValueError(
                    f"the column {column.title!r} needs the mode {column.mode!r} of the set {column.set!r}"
                )
        for name, system in self.systems.items():
            _known(f"systems.{name}: data", system.data, self.data)
            _known(f"systems.{name}: sets", system.sets, self.sets)
        return self


def model_name(config: BaseModel) -> str:
    """The name of a model's weights, else its kind: what judges and systems may share."""
    return str(getattr(config, "model", None) or getattr(config, "kind", ""))


def _known(what: str, names: Any, known: Any) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f"{what}: there is no {name!r} among {', '.join(known)}")
