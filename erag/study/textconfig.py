"""What `erag distil` runs for students of text roles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from erag.lm.adapter import EmbedderConfig
from erag.lm.config import ModelConfig
from erag.lm.cross_header import Pooling
from erag.lm.probe import DtypeWish
from erag.lm.sentence import SentenceConfig
from erag.study.decisions import DecisionSource, Part


class _Config(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TextTraining(_Config):
    """How a student of a text role is trained; the same numbers come out of a run that was killed and resumed."""

    epochs: int = Field(30, ge=1, le=1000)
    batch_size: int = Field(64, ge=2, le=4096)
    rate: float = Field(2e-3, gt=0, le=1, description="highest learning rate; warm-up and cosine around it")
    decay: float = Field(0.05, ge=0, le=1, description="weight decay of matrices")
    dropout: float = Field(0.4, ge=0, lt=1, description="of components of the frozen vectors")
    seed: int = 0
    wandb: bool = True
    threads: int | None = Field(None, ge=1, le=1024)


class CrossTraining(TextTraining):
    """How a cross-encoder is trained; `batch_size` counts decisions."""

    epochs: int = Field(5, ge=1, le=1000)
    batch_size: int = Field(16, ge=2, le=4096)
    rate: float = Field(2e-4, gt=0, le=1, description="highest learning rate; warm-up and cosine around it")
    dropout: float = Field(0.1, ge=0, lt=1, description="of what the taught layers say")
    dtype: DtypeWish = Field("auto", description="of products in training; what is taught stays float32")


class ChoiceDistil(_Config):
    """A student of select and score, taught by decisions.

    `folds` of questions, and of sets of cards, are each left out once; the figures are of what was left out. `compare`
    are models that select, judged on the same decisions. What is in the part `without` is not seen at all, so that
    `erag compare` can ask it.
    """

    decisions: tuple[DecisionSource, ...] = Field(min_length=1)
    without: Part | None = None
    taught_by: str = Field(max_length=500, description="the teacher, and what follows for the use of the weights")
    embedder: EmbedderConfig = SentenceConfig(dtype="float32")
    folds: int = Field(5, ge=2, le=20)
    compare: dict[str, ModelConfig] = {}
    resamples: int = Field(2000, ge=10, description="of the bootstrap over questions, or over sets of cards")


class AdapterShape(_Config):
    """How large an adapter is, and how it is trained.

    The loss of a decision is (1 - `relevance`) × the cross-entropy over its cards + `relevance` × the binary one of its
    cards and of `negatives` cards of other decisions, each on its own: a selector needs the first, a scorer the second.
    """

    rank: int = Field(128, ge=1, le=1024)
    members: int = Field(4, ge=1, le=64)
    relevance: float = Field(0.2, ge=0, le=1)
    negatives: int = Field(8, ge=1, le=256)
    strange: float = Field(0.3, ge=0, lt=1, description="of decisions in training, taken as of cards never seen")
    trusted_from: float = Field(0.9, ge=0, lt=1, description="cosine to a seen card from which on a card is trusted")
    training: TextTraining = TextTraining()


class AdapterDistil(AdapterShape, ChoiceDistil):
    """An adapter on frozen embeddings of `embedder`.

    For each number of questions of `curve` adapters are taught and judged as well, a fold at a time.
    """

    kind: Literal["selector", "scorer"]
    curve: tuple[Annotated[int, Field(ge=1)], ...] = ()
    work: Path = Path("experiments/distil/selector")
    out: Path = Path("checkpoints/selector.safetensors")


class CrossDistil(ChoiceDistil):
    """A cross-encoder: the BERT `base` of the store reads query and card together, cut to `max_tokens`.

    Its upper `layers` and one linear score are taught, what is below stays as it is. The loss of a decision is
    (1 - `relevance`) × the cross-entropy over its cards + `relevance` × the binary one of its cards, each on its own.
    `call` pairs of about equal length are computed together. The cosine is that of `embedder`; `beside` is an adapter
    on the same vectors, trained and judged on the same parts of the decisions (null: none), alone and with it.
    """

    kind: Literal["cross_encoder"]
    base: str = "minilm-l6"
    layers: int = Field(3, ge=1, le=48)
    pooling: Pooling = "mean"
    max_tokens: int = Field(64, ge=8, le=512)
    relevance: float = Field(0.2, ge=0, le=1)
    call: int = Field(32, ge=1, le=4096)
    beside: AdapterShape | None = AdapterShape()
    work: Path = Path("experiments/distil/cross-encoder")
    out: Path = Path("checkpoints/cross-encoder.safetensors")
    training: CrossTraining = CrossTraining()


class Wishing(_Config):
    """Wishes, what a teacher names for them, and how a student without a language model learns to name it.

    The wishes are `erag.study.wishes`, each need said in `ways` ways; what the teacher names is kept in `work`, so that
    it is asked once. Things named for fewer than `fewest` wishes are left out. A query is projected towards what was
    named for queries like it, by regression with the penalty `ridge`; the projection counts `blend` times as much as
    the query itself, and `prior` × the logarithm of how often a thing was named is added.
    """

    teacher: ModelConfig
    ways: int = Field(2, ge=1, le=11)
    things: int = Field(6, ge=1, le=12)
    fewest: int = Field(2, ge=1)
    limit: int | None = Field(None, ge=1, description="the first so many wishes only")
    embedder: EmbedderConfig = SentenceConfig(dtype="float32")
    ridge: float = Field(3.0, gt=0, allow_inf_nan=False)
    blend: float = Field(0.6, ge=0, allow_inf_nan=False)
    prior: float = Field(0.02, ge=0, allow_inf_nan=False)
    seed: int = 0
    work: Path = Path("experiments/distil/understanding")


class UnderstandingDistil(Wishing):
    """Query understanding without a language model; `folds` of needs are each left out once."""

    kind: Literal["understanding"]
    taught_by: str = Field(max_length=500, description="the teacher, and what follows for the use of the weights")
    folds: int = Field(5, ge=2, le=20)
    out: Path = Path("checkpoints/understanding.safetensors")
    resamples: int = Field(2000, ge=10)
