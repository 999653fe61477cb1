"""The panel of an experiment: judges of a configuration over the truth of an environment, their calls recorded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from erag.core.errors import BadModelOutput
from erag.core.progress import Progress
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.judges.each import EachJudge
from erag.evaluate.judges.embedding import EmbeddingJudge
from erag.evaluate.judges.expanded import ExpandedJudge
from erag.evaluate.judges.labels import LabelJudge
from erag.evaluate.judges.lexical import LexicalJudge
from erag.evaluate.judges.model import ModelJudge
from erag.evaluate.judges.protocol import Floats, Judge, Panel
from erag.evaluate.judges.relevance import RelevanceJudge
from erag.evaluate.truth import Pair
from erag.experiment.config import JudgeConfig, PanelConfig
from erag.lm.config import BackendConfig, WriterConfig, build_backend
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.roles import LMBackend, RoleName
from erag.lm.weights import ModelStore
from erag.memory.calls import Calls
from erag.memory.file import MemoryFile
from erag.retrieve.config import ExpandConfig
from erag.retrieve.expand import Expander
from erag.retrieve.uses import KnownEmbedder

THINGS = 5  # what a question is expanded to, at most


@dataclass
class Bench:
    """Where judges sit: the models they ask, loaded once, each call recorded on disk and never made again."""

    config: PanelConfig
    embedder: KnownEmbedder
    embedder_name: str
    store: ModelStore
    calls: Calls
    ledger: Ledger
    progress: Progress

    def __post_init__(self) -> None:
        self._journals: dict[str, Journal] = {}
        self._expander = self._made_expander()
        self.unexpanded = 0  # questions for which the expander named nothing

    def panel(self, environment: Environment) -> Panel:
        """The judges over an environment's truth; what its questions are expanded to is asked of the model here."""
        expansions = self._expansions(environment.questions)
        return Panel(tuple(self._judge(n, c, environment, expansions) for n, c in self.config.judges.items()))

    def _judge(
        self, name: str, config: JudgeConfig, environment: Environment, expansions: Mapping[str, Sequence[str]]
    ) -> Judge:
        judge, models = self._plain(name, config, environment), self.config.models(name, self.embedder_name)
        judge = EachJudge(judge, looks=config.each == "objects") if config.each is not None else judge
        if config.expanded is None:
            return _Named(judge, name, models)
        kinds = self.config.expand_kinds
        stated = {q.id: tuple(sorted(q.targets or ())) if q.kind in kinds else () for q in environment.questions}
        return _Named(ExpandedJudge(judge, expansions if config.expanded == "model" else stated), name, models)

    def _plain(self, name: str, config: JudgeConfig, environment: Environment) -> Judge:
        truths = list(environment.truths.by_node.values())
        if config.kind == "labels":
            return LabelJudge.over(o for t in truths for o in t.objects or ())
        if config.kind == "words":
            return LexicalJudge.over(truths)
        if config.kind == "embedding":
            return EmbeddingJudge(name, self.embedder)
        if config.kind == "relevance":
            return RelevanceJudge.over(truths, self.embedder)
        if config.model is None:
            raise ValueError(f"the judge {name!r} has no model")
        return ModelJudge(name, self._journal(config.model, "score"))

    def _journal(self, config: WriterConfig, role: RoleName) -> Journal:
        """The recorded model of a configuration; judges of one configuration share it."""
        key = f"{role} {config.model_dump_json()}"
        if key not in self._journals:
            backend = build_backend(BackendConfig(models={"judge": config}, roles={role: "judge"}), self.store)
            self._journals[key] = Journal(backend, self.calls, self.ledger, self.progress)
        return self._journals[key]

    def _made_expander(self) -> Expander | None:
        if self.config.expander is None:
            return None
        return Expander(self._journal(self.config.expander, "generate"), ExpandConfig(things=THINGS))

    def _expansions(self, questions: Sequence[Question]) -> dict[str, tuple[str, ...]]:
        """What the model names for each question of a kind that is expanded, from its text alone; else nothing."""
        found: dict[str, tuple[str, ...]] = {q.id: () for q in questions}
        if self._expander is None:
            return found
        for question in questions:
            if question.kind in self.config.expand_kinds and question.text:
                try:
                    (found[question.id],) = self._expander.things([question.text])
                except BadModelOutput:
                    self.unexpanded += 1
        return found


@contextmanager
def bench(
    config: PanelConfig, embedder: LMBackend, embedder_name: str, work: Path, store: ModelStore, progress: Progress
) -> Iterator[Bench]:
    """The bench of an experiment; its record of calls, `judges.erag` in the work folder, serves all experiments."""
    work.mkdir(parents=True, exist_ok=True)
    with MemoryFile.writing(work / "judges.erag", "erag run", create=True) as memory:
        ledger = Ledger()
        recorded = Journal(embedder, memory.calls, ledger, progress)
        yield Bench(config, recorded, embedder_name, store, memory.calls, ledger, progress)


@dataclass(frozen=True)
class _Named:
    """A judge under the name the configuration gives it, with the weights it rests on."""

    judge: Judge
    name: str
    models: frozenset[str]

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`."""
        return self.judge.probabilities(pairs)
