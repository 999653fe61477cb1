"""Simulated worlds as memories whose captions are told from the ground truth, with their labelled questions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from erag.bench.config import MemoryBench, WorldsConfig
from erag.bench.retrieval import built
from erag.core.progress import Progress, quiet
from erag.data.reading import Reading
from erag.data.registry import read
from erag.data.writer import write_folder
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.datasets.simulated import load
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig


@dataclass(frozen=True)
class LabelledWorld:
    """A built memory of a world, and what is asked there."""

    name: str
    memory: Path
    questions: tuple[Question, ...]

    def of(self, task: str) -> list[Question]:
        """The questions of one task of the simulator: `find`, `unanswerable` and so on."""
        return [q for q in self.questions if (q.line.raw or {}).get("task") == task]

    @property
    def finds(self) -> list[Question]:
        """The find questions whose words alone say what is right: those without a wish for a sensor's reading."""
        return [q for q in self.of("find") if not (q.line.raw or {}).get("sensor")]


def labelled_worlds(
    config: WorldsConfig, pipeline: PipelineConfig, store: ModelStore, progress: Progress = quiet
) -> Iterator[LabelledWorld]:
    """The worlds below `config.root`, each built when its turn comes; nothing is done twice.

    Place nodes only, without images: whatever captions the data set has, the memory holds those of the truth. Raises
    InputError where there is no world of the split.
    """
    found = load(config.root, None).of_split(config.split).environments
    for done, environment in enumerate(found, 1):
        source = config.folder / "sources" / environment.name
        write_folder(source, told(environment))
        memory = config.folder / f"{environment.name}.erag"
        built(MemoryBench(source=str(source), memory=memory, pipeline=pipeline), store)
        yield LabelledWorld(environment.name, memory, environment.questions)
        progress("worlds", done, len(found))


def told(environment: Environment) -> Reading:
    """What was seen at the places of a world, in the words of the ground truth."""
    reading = read(environment.source, environment.reader)
    places = tuple(
        replace(o, image=None, caption=environment.truths.of(o.id).caption)
        for o in reading.observations
        if o.kind == "place"
    )
    ids = {o.id for o in places}
    edges = tuple(e for e in reading.edges if e.a in ids and e.b in ids)
    return replace(reading, observations=places, edges=edges, clusters=(), issues=())
