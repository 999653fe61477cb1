"""Adapters of one base model on the items of a task: trained, merged, written as GGUF and asked; kept as it goes."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from erag.core.progress import Progress
from erag.core.text import content_hash
from erag.lm.checkpoints import save
from erag.lm.compose import compose
from erag.lm.llamacpp.quantise import variants_store
from erag.lm.merging import merged
from erag.lm.probe import choose_dtype
from erag.lm.roles import Roles
from erag.lm.textroles import TextRoles
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.torchlm.container import open_container
from erag.lm.torchlm.lora import HEADER, LoraHeader
from erag.lm.torchlm.shape import shape_of
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.torchlm.weights import dequantised, rope_factors
from erag.lm.weights import ModelStore
from erag.lm.weights.digest import write_durably
from erag.study.lessons import Answer, Task, drill
from erag.study.loraconfig import LoraDistil

UNTAUGHT = "untaught"


@dataclass(frozen=True, slots=True)
class Answered:
    """What a model in a file of so many bytes answered."""

    bytes: int
    answers: tuple[Answer, ...]


class Tutor:
    """Trains under folders named by everything the weights depend on, so that no run resumes another one."""

    def __init__(self, config: LoraDistil, task: Task, store: ModelStore, progress: Progress) -> None:
        self._config, self._task, self._store, self._progress = config, task, store, progress
        self._file = open_container(store.path(config.base))
        self._shape = shape_of(self._file)
        self.header = LoraHeader(
            base=config.base, weights=store.fingerprint(config.base), taught=config.task.kind, rank=config.rank,
            alpha=config.alpha, taught_by=config.taught_by,
        )  # fmt: skip
        self.lessons = [task.lessons(row) for row in range(len(task.groups))]
        self._dtype = choose_dtype(config.training.dtype)
        said = [f"{lesson.messages} {lesson.answer}" for own in self.lessons for lesson in own]
        trained = config.training.model_dump_json(exclude={"wandb", "threads", "dtype"})
        parts = json.dumps([config.folds, config.most, list(task.groups)])
        key = content_hash(self.header.model_dump_json(), trained, parts, self._dtype, *said).hex()[:12]
        self._folder = config.work / f"run-{key}"

    def train(self, name: str, rows: Sequence[int], out: Path) -> None:
        """Write the adapter that was taught the items `rows`; goes on from the last epoch where there is one."""
        import torch

        from erag.study.lowrank import LowRank
        from erag.study.tuning import train

        def told(stage: str, done: int, total: int) -> None:
            self._progress(f"{name}: {stage}", done, total)

        taught = drill([lesson for row in rows for lesson in self.lessons[row]], Vocabulary(self._file), self._shape)
        torch.manual_seed(self._config.training.seed)
        tensors = dequantised(self._file, self._shape, self._dtype)
        network = LowRank(self._shape, tensors, self._config.rank, self._config.alpha, rope_factors(self._file))
        factors = train(network, taught, self._config.training, self._folder / name, told)
        save(out, HEADER, self.header, factors)

    def left_out(self, name: str, rows: Sequence[int], out: Sequence[int]) -> Mapping[str, Answered]:
        """The answers to the items `out` of the base, and of each form of what was taught the items `rows`."""
        folder = self._folder / name
        missing = [form for form in self._config.forms if not (folder / f"{form}.json").is_file()]
        if missing:
            self.train(name, rows, folder / "adapter.safetensors")
            made = merged(
                folder / "adapter.safetensors", missing, self._store, folder / "models",
                threads=self._config.training.threads or os.cpu_count() or 1,
            )  # fmt: skip
            models = variants_store(folder / "models")
            for form, manifest in made.items():
                self._keep(folder / f"{form}.json", manifest.id, models, out, folder / "models" / "cache")
            shutil.rmtree(folder / "models")
        if not (folder / f"{UNTAUGHT}.json").is_file():
            self._keep(folder / f"{UNTAUGHT}.json", self._config.base, self._store, out)
        return {form: _read(folder / f"{form}.json") for form in (UNTAUGHT, *self._config.forms)}

    def _keep(self, path: Path, model: str, store: ModelStore, rows: Sequence[int], cache: Path | None = None) -> None:
        """Ask a model of a store and keep its answers in a file."""
        engine = TorchLM(TorchLMConfig(model=model, dtype=self._dtype), store, cache=cache)
        backend = compose({"one": TextRoles(engine, self._task.text)}, Roles({self._task.role: "one"}))
        answers = self._task.answers(backend, rows)
        size = store.path(model).stat().st_size
        write_durably(path, json.dumps({"bytes": size, "answers": answers}, ensure_ascii=False))


def _read(path: Path) -> Answered:
    raw = json.loads(path.read_text(encoding="utf-8"))
    return Answered(raw["bytes"], tuple(map(tuple, raw["answers"])))
