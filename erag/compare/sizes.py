"""How large the files of models are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from pydantic import BaseModel

from erag.lm import adapter, cross, student_checkpoint, understanding
from erag.lm.adapter import AdapterConfig
from erag.lm.checkpoints import shipped
from erag.lm.cross import CrossEncoderConfig
from erag.lm.llamacpp.backend import LlamaCpp
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.student import StudentConfig
from erag.lm.student_checkpoint import read_words
from erag.lm.torchlm import TorchLMConfig
from erag.lm.torchlm.lora import located
from erag.lm.understanding import UnderstandingConfig
from erag.lm.weights import ModelStore

_SHIPPED: dict[type[BaseModel], str] = {
    AdapterConfig: adapter.SHIPPED, CrossEncoderConfig: cross.SHIPPED, StudentConfig: student_checkpoint.SHIPPED,
    UnderstandingConfig: understanding.SHIPPED,
}  # fmt: skip


def model_mb(models: Iterable[BaseModel], store: ModelStore) -> float | None:
    """MB of all that has to be there for models to compute, each file once; None where nothing has to."""
    files = {path: size for model in models for path, size in _files(model, store)}
    return sum(files.values()) / 1e6 if files else None


def _files(model: BaseModel, store: ModelStore) -> Iterator[tuple[Path, int]]:
    """Files and folders with their bytes: weights of the store, checkpoints, and those of models within."""
    if isinstance(model, LlamaCppConfig):
        yield from _sized(LlamaCpp(model, store).file())
        return
    if isinstance(model, TorchLMConfig) and model.lora is not None:
        yield from _sized(located(model.lora))
    if type(model) in _SHIPPED:
        checkpoint: Path = getattr(model, "checkpoint", None) or shipped(_SHIPPED[type(model)])
        yield from _sized(checkpoint)
        if isinstance(model, StudentConfig) and checkpoint.is_file():
            yield from _stored(read_words(checkpoint).backbone, store)
        if isinstance(model, CrossEncoderConfig) and checkpoint.is_file():
            yield from _stored(cross.header_of(checkpoint).base, store)
    for value in (getattr(model, name) for name in type(model).model_fields):
        yield from _within(value, store)


def _within(value: object, store: ModelStore) -> Iterator[tuple[Path, int]]:
    """Of a setting: the model it names, the file it says, the models it holds."""
    if isinstance(value, str):
        yield from _stored(value, store)
    elif isinstance(value, Path):
        yield from _sized(value)
    elif isinstance(value, BaseModel):
        yield from _files(value, store)
    elif isinstance(value, tuple):
        for one in value:
            yield from _within(one, store)


def _stored(name: str, store: ModelStore) -> Iterator[tuple[Path, int]]:
    if name in {manifest.id for manifest in store.all()}:
        yield store.folder(name), store.manifest(name).bytes or 0


def _sized(path: Path) -> Iterator[tuple[Path, int]]:
    if path.is_file():
        yield path, path.stat().st_size
