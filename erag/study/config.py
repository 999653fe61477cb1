"""What `erag distil` runs."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from erag.lm.config import BackendConfig, ModelConfig
from erag.lm.probe import DtypeWish


class TrainingConfig(BaseModel):
    """How the student is trained; the same numbers come out of a run that was killed and resumed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    epochs: int = Field(30, ge=1, le=1000)
    batch_size: int = Field(32, ge=2, le=1024)
    rate: float = Field(2e-3, gt=0, le=1, description="highest learning rate; warm-up and cosine around it")
    decay: float = Field(0.02, ge=0, le=1, description="weight decay")
    average: float = Field(0.995, ge=0, lt=1, description="how slowly the averaged weights follow")
    channel_dropout: float = Field(0.1, ge=0, lt=1)
    dtype: DtypeWish = Field("auto", description="of products in training; weights stay float32")
    seed: int = 0
    wandb: bool = True
    threads: int | None = Field(None, ge=1, le=1024)


class DistilConfig(BaseModel):
    """A captioner taught by simulated worlds.

    `worlds` is where data sets are: `seedN` for each of `seeds`, with the worlds `train`; `viewsN` for each of
    `view_seeds`, with `views` cameras before the objects of every class of those worlds. For the first seed there are
    `studiosN`, `studios` random scenes in which objects stand where they never would, `paintedN`, `painted` more in
    which they have colours they never would, and `held-outN`, with the worlds `held_out`, which are never trained on.
    What is missing is rendered. `work` keeps cached features, checkpoints and logs; `out` is the student's file, its
    card is written beside it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["captioner"]
    worlds: Path
    train: tuple[str, ...] = Field(min_length=1)
    held_out: tuple[str, ...] = ()
    seeds: tuple[int, ...] = Field((0,), min_length=1)
    view_seeds: tuple[int, ...] = ()
    views: int = Field(4, ge=1, le=1000)
    studios: int = Field(0, ge=0, le=10_000)
    painted: int = Field(0, ge=0, le=10_000)
    work: Path = Path("experiments/distil/captioner")
    out: Path = Path("checkpoints/captioner.safetensors")
    backbone: str = "efficientnet-lite0"
    backend: BackendConfig = BackendConfig()
    width: int = Field(128, ge=8, le=1024)
    depth: int = Field(3, ge=1, le=12)
    least_share: float = Field(0.01, gt=0, lt=1, description="of the image; from here on an object counts as visible")
    compare: dict[str, ModelConfig] = Field({}, description="captioners to be judged on the held-out worlds as well")
    synonyms: dict[str, tuple[str, ...]] = Field({}, description="class -> other words that name it, for `compare`")
    variants: int = Field(1, ge=0, le=20, description="further looks at each image: parts of it in other hues")
    fewest: int = Field(8, ge=1, description="images a class or attribute must be seen in to be learnt")
    training: TrainingConfig = TrainingConfig()
    resamples: int = Field(1000, ge=10, description="of the bootstrap")
