"""The words a student knows, and what else its checkpoint says of it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, model_validator


class StudentWords(BaseModel):
    """What the outputs of a student's network stand for, in order.

    `thresholds` are the probabilities from which on each class is said to be in view; `weights` is the sha256 (hex) of
    the backbone's file, `rules` the version of the features, `dim` the length of the text embedder's vectors and
    `embedder` its identity.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    objects: tuple[str, ...] = Field(min_length=1)
    colours: tuple[str, ...]
    shapes: tuple[str, ...]
    places: tuple[str, ...] = Field(min_length=1)
    lights: tuple[str, ...] = Field(min_length=1)
    thresholds: tuple[float, ...]
    dim: int = Field(ge=1)
    width: int = Field(128, ge=8, le=1024)
    depth: int = Field(3, ge=1, le=12)
    backbone: str = "efficientnet-lite0"
    weights: str
    embedder: str
    rules: int

    @model_validator(mode="after")
    def _consistent(self) -> StudentWords:
        if len(self.objects) != len(self.thresholds):
            raise ValueError("objects and thresholds differ in number")
        if any(not 0 < t <= 1 for t in self.thresholds):
            raise ValueError("a threshold lies outside (0, 1]")
        return self
