"""The kinds of students and of quantisation studies, and what runs each."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Protocol

from pydantic import ConfigDict, Field, RootModel

from erag.core.progress import Progress, quiet
from erag.lm.weights import ModelStore
from erag.study.config import DistilConfig
from erag.study.loraconfig import LoraDistil
from erag.study.quantconfig import EncoderStudy, GgufStudy, VectorStudy
from erag.study.shown import Shown
from erag.study.textconfig import AdapterDistil, CrossDistil, UnderstandingDistil

Distil = DistilConfig | AdapterDistil | CrossDistil | UnderstandingDistil | LoraDistil
Quantise = GgufStudy | VectorStudy | EncoderStudy


class AnyDistil(RootModel[Annotated[Distil, Field(discriminator="kind")]]):
    """A student's configuration file."""

    model_config = ConfigDict(frozen=True)


class Report(Protocol):
    """What came of a training, whatever was trained."""

    @property
    def out(self) -> Path: ...

    @property
    def bytes(self) -> int: ...

    @property
    def seconds(self) -> Mapping[str, float]: ...

    def table(self) -> Shown: ...


def run(config: Distil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Train, judge and write a student with its card; what is imported depends on its kind."""
    match config:
        case DistilConfig():
            from erag.study.distil import distil as captioner

            return captioner(config, store, progress)
        case AdapterDistil():
            from erag.study.selector import distil as selector

            return selector(config, store, progress)
        case CrossDistil():
            from erag.study.cross import distil as cross

            return cross(config, store, progress)
        case UnderstandingDistil():
            from erag.study.understanding import distil as understanding

            return understanding(config, store, progress)
        case LoraDistil():
            from erag.study.lora import distil as lora

            return lora(config, store, progress)


def quantise(config: Quantise, store: ModelStore, progress: Progress = quiet) -> Shown:
    """Run a quantisation study; its table."""
    match config:
        case GgufStudy():
            from erag.study.variants import run as variants

            return variants(config, store, progress).table()
        case VectorStudy():
            from erag.study.vectorstudy import run as vectors

            return vectors(config, store, progress).table()
        case EncoderStudy():
            from erag.study.encoderstudy import run as encoder

            return encoder(config, store, progress).table()
