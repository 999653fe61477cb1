"""The local planner: a Protocol for any robot's, and a simulated one that follows waypoints with an unsure position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

Point = npt.NDArray[np.float64]  # (3,) metres in a local frame, z up or down as the map has it
Ending = Literal["arrived", "blocked", "lost"]
Metres = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_SPARE_STEPS = 50  # granted to every leg beside those its length asks for


@dataclass(frozen=True, slots=True)
class Leg:
    """One stretch of a way: the `target` (3,) to drive to, and whether something unknown to the map blocks it."""

    target: Point
    blocked: bool = False


@dataclass(frozen=True, slots=True)
class Drive:
    """What a planner did: where the robot really stands (3,), metres driven, how many legs it finished, how it ended.

    `arrived` is what the robot believes; with `blocked` the leg after the finished ones is, and with `lost` it gave up.
    """

    position: Point
    metres: float
    finished: int
    ending: Ending


class LocalPlanner(Protocol):
    """Drives along legs. Any robot's planner fits that can say where it stopped and why; one object, many trips."""

    def follow(self, start: Point, legs: Sequence[Leg], seed: int) -> Drive:
        """Drive from `start` (3,) along `legs` in order, until the end, a blocked leg, or despair.

        The same arguments give the same drive.
        """
        ...


class FollowerConfig(BaseModel):
    """A simulated waypoint follower, in metres.

    Each `step` it goes straight for the target as seen from its estimate of where it is: the truth and a normal error
    of standard deviation `noise` on x and y. A waypoint counts as reached when the estimate is within `arrival` of it.
    A blocked leg is noticed after the share `notice` of it was driven. It gives up a leg after `patience` times the
    steps its length asks for.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["follower"] = "follower"
    step: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.5
    noise: Metres = 0.2
    arrival: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.5
    notice: Annotated[float, Field(ge=0, le=1)] = 0.5
    patience: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 5.0


class WaypointFollower:
    """The planner of a `FollowerConfig`; without noise its way is the polyline of the waypoints."""

    def __init__(self, config: FollowerConfig | None = None) -> None:
        self._config = config or FollowerConfig()

    def follow(self, start: Point, legs: Sequence[Leg], seed: int) -> Drive:
        """See `LocalPlanner`."""
        rng, position, driven = np.random.default_rng(seed), np.asarray(start, np.float64), 0.0
        for finished, leg in enumerate(legs):
            target = position + (leg.target - position) * self._config.notice if leg.blocked else leg.target
            position, metres, there = self._drive(position, target, rng)
            driven += metres
            if leg.blocked:
                return Drive(position, driven, finished, "blocked")
            if not there:
                return Drive(position, driven, finished, "lost")
        return Drive(position, driven, len(legs), "arrived")

    def _drive(self, position: Point, target: Point, rng: np.random.Generator) -> tuple[Point, float, bool]:
        """Where a drive to `target` ends, its metres, and whether the robot believes it is there."""
        config, driven = self._config, 0.0
        steps = _SPARE_STEPS + int(config.patience * np.linalg.norm(target - position) / config.step)
        for _ in range(steps):
            error = np.append(rng.normal(0.0, config.noise, 2), 0.0) if config.noise else np.zeros(3)
            ahead = target - (position + error)
            left = float(np.linalg.norm(ahead))
            if left <= config.arrival and (config.noise or left == 0.0):
                return position, driven, True
            length = min(config.step, left)
            position, driven = position + ahead * (length / left), driven + length
        return position, driven, False
