"""What a page may hold: the limits of its pictures, and whether it says how long answers took."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[int, Field(ge=1)]


class PictureConfig(BaseModel):
    """Limits of the pictures of a page, and of the image files they are made from.

    `side` is the longer side of a thumbnail in pixels; with more than `full_size` images it shrinks so that the page
    keeps its size, never below `least_side`. `total_bytes` bounds all thumbnails together, as they stand in the page.
    Files above `file_bytes` or `pixels` are not decoded.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    side: Annotated[int, Field(ge=16, le=2048)] = 360
    least_side: Annotated[int, Field(ge=16, le=2048)] = 112
    full_size: Positive = 250
    quality: Annotated[int, Field(ge=10, le=95)] = 72
    total_bytes: Positive = 16_000_000
    file_bytes: Positive = 64_000_000
    pixels: Positive = 60_000_000


class ReportConfig(BaseModel):
    """How a page is made. Without `seconds` it is the same bytes for the same memory, questions and models."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pictures: PictureConfig = PictureConfig()
    seconds: bool = True
