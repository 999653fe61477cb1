"""What a forest is built with: weights, cut rules, size limits and memory limits."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

PositiveMetres = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Similarity = Annotated[float, Field(ge=-1, le=1)]
AUTHORS_CUTS = (0.40, 0.44, 0.48, 0.52, 0.56)


class ShrinkCuts(BaseModel):
    """Cut each level so that it has `1 / ratio` of the rows below it: independent of the embedder's range of cosines.

    `floor` is the smallest similarity S of any two members at which a merge still means something.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    kind: Literal["shrink"] = "shrink"
    first: float = Field(default=16.0, gt=1, description="base nodes per row of level 1")
    upper: float = Field(default=4.5, gt=1, description="rows of a level per row of the next, above level 1")
    floor: Similarity = 0.05

    def ratio(self, level: int) -> float:
        """How many rows of the level below make one row of `level` (1 is the first)."""
        return self.first if level == 1 else self.upper


class FixedCuts(BaseModel):
    """Cut level l at `heights[l - 1]` on 1 - S, as the authors do; there are at most as many levels as heights."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    kind: Literal["fixed"] = "fixed"
    heights: tuple[Annotated[float, Field(ge=0, le=2)], ...] = Field(default=AUTHORS_CUTS, min_length=1)


def _kind(cuts: Any) -> Any:
    """The kind of cuts; `shrink` where none is named, so that one of its values can be set alone."""
    return cuts.get("kind", "shrink") if isinstance(cuts, dict) else getattr(cuts, "kind", None)


Cuts = Annotated[
    Annotated[ShrinkCuts, Tag("shrink")] | Annotated[FixedCuts, Tag("fixed")],
    Discriminator(_kind, custom_error_type="kind", custom_error_message="the kind of cuts is shrink or fixed"),
]


class ForestConfig(BaseModel):
    """How `build_forest` builds (paper, semantic forest; the paper's α of the clustering is `alpha`).

    `theta` in metres, or `auto`: the extent of a typical level-1 cluster of this map. Clusters have `min_size` to
    `max_size` members, which are rows of the level below. `cluster_embedding`: what stands for a cluster when the next
    level is made, the mean of its base nodes or its summary. Up to `dense_limit` rows are clustered through one full
    matrix (about 50 bytes a pair of rows); above it the closest pairs are searched in passes, at most `edge_limit` held
    at a time (about 60 bytes each), in at most `max_passes` passes a level.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    alpha: float = Field(default=0.6, ge=0, le=1)
    theta: PositiveMetres | Literal["auto"] = "auto"
    cuts: Cuts = ShrinkCuts()
    min_size: int = Field(default=2, ge=2)
    max_size: int = Field(default=100, ge=2)
    max_levels: int = Field(default=12, ge=1)
    cluster_embedding: Literal["mean", "summary"] = "mean"
    dense_limit: int = Field(default=4000, ge=2, le=40_000)
    edge_limit: int = Field(default=20_000_000, ge=8, le=2_000_000_000)
    max_passes: int = Field(default=64, ge=1)

    @model_validator(mode="after")
    def _sizes(self) -> ForestConfig:
        if self.min_size > self.max_size:
            raise ValueError(f"min_size {self.min_size} is larger than max_size {self.max_size}")
        return self
