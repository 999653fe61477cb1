"""What an experiment has to ask: every system, question and mode, and which of these is answered already."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from erag.data.contract import QueryLine
from erag.evaluate.scene import Scene
from erag.experiment.answered import Answered
from erag.experiment.config import ExperimentConfig, Mode, SystemConfig
from erag.experiment.memories import Memory
from erag.experiment.predictions import Key, Prediction
from erag.experiment.questions import Posed, chosen, modes_of
from erag.experiment.sources import Source
from erag.experiment.systems import Asked, Loaded, pipeline_of
from erag.pipeline.config import PipelineConfig


@dataclass(frozen=True)
class Ground:
    """An environment ready to be asked about: its source, its own map, and the questions."""

    source: Source
    scene: Scene
    questions: tuple[Posed, ...]


MemoryOf = Callable[[Ground, PipelineConfig], Memory]


@dataclass(frozen=True)
class Due:
    """A system to be asked a question in a mode; `first` marks the first mode of the question."""

    asked: Asked
    question: Posed
    mode: Mode
    line: QueryLine
    first: bool

    @property
    def key(self) -> Key:
        return (self.asked.name, *self.question.key, self.mode)

    @property
    def fingerprint(self) -> str:
        """Of all that determines the answer but the code."""
        return self.asked.fingerprint(self.line)

    def answer(self, answered: Answered, anew: bool) -> tuple[Prediction, bool]:
        """The answer that another experiment of the work folder has, else (or `anew`) a new one; whether it is new."""
        known = None if anew else answered.get(self.fingerprint, self.first)
        if known is not None:
            return self.asked.adopted(known, self.question, self.mode, self.line, self.first), False
        prediction = self.asked.predict(self.question, self.mode, self.line, self.first)
        answered.add(prediction)
        return prediction, True


def everything(
    config: ExperimentConfig, grounds: Sequence[Ground], memory_of: MemoryOf, loaded: Loaded
) -> Iterator[Due]:
    """Every system, environment, question and mode, in this order; nothing is loaded for it."""
    questions = [q for g in grounds for q in g.questions]
    for name, system in config.systems.items():
        wanted = {q.key for q in chosen(questions, system, config.seed)}
        for ground in grounds:
            here = [q for q in ground.questions if q.key in wanted]
            if here:
                memory = memory_of(ground, pipeline_of(system))
                asked = Asked(name, system, memory, ground.scene, loaded, config.top)
                yield from (due for q in here for due in _modes(asked, q, system, config))


def _modes(asked: Asked, question: Posed, system: SystemConfig, config: ExperimentConfig) -> Iterator[Due]:
    sets = tuple(s for s in question.sets if not system.sets or s in system.sets)
    first = modes_of(question, config.sets)[:1]
    for mode in modes_of(replace(question, sets=sets), config.sets):
        line = question.line(mode)
        if line is not None:
            yield Due(asked, question, mode, line, [mode] == first)


def parted(wanted: Iterable[Due], known: Mapping[Key, Prediction]) -> tuple[list[Due], list[Prediction]]:
    """What is still to be asked, and the known answers that are those of this configuration."""
    due, kept = list[Due](), list[Prediction]()
    for one in wanted:
        prediction = known.get(one.key)
        if prediction is not None and prediction.fingerprint == one.fingerprint:
            kept.append(prediction)
        else:
            due.append(one)
    return due, kept
