"""What a cross-encoder's checkpoint says of itself."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

RULES = 1  # changes when a network would make other numbers of the same texts
Pooling = Literal["mean", "first"]


class CrossHeader(BaseModel):
    """The BERT below (its id in the store and its fingerprint there), how it reads, and what makes chances of logits.

    `layers` are the upper ones, which the checkpoint holds; what is below them is the store's. `pooling` is what the
    number is made of: the mean of all tokens, or the `first`, [CLS].
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    base: str = Field(max_length=64)
    weights: str = Field(pattern=r"^[0-9a-f]{64}$")
    layers: int = Field(ge=1, le=48)
    pooling: Pooling = "mean"
    max_tokens: int = Field(ge=8, le=512)
    rules: int = RULES
    slope: float = Field(1.0, gt=0, allow_inf_nan=False)
    offset: float = Field(0.0, allow_inf_nan=False)
    taught_by: str = Field("", max_length=500)
