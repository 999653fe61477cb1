"""What is read out of the words of a question besides what it asks for: sensors, times, visits."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from erag.aware.channels import ChannelWords


class AwareConfig(BaseModel):
    """Sensors and times in the words of questions.

    `read_sensors` and `read_times` say whether words are read for them at all; conditions that a query states apart
    from its words always win. `channels` adds to the shipped words of sensor channels. `visit_gap` is the pause in
    seconds that separates two visits (None: from the map), `stale_after` the age in seconds from which on an answer
    tells how old what it rests on is, `hours_ahead` how far the local time that words speak of is ahead of UTC.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    read_sensors: bool = True
    read_times: bool = True
    channels: dict[str, ChannelWords] = {}
    visit_gap: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    stale_after: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 86_400.0
    hours_ahead: Annotated[float, Field(ge=-14, le=14)] = 0.0
