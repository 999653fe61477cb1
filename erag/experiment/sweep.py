"""A sweep as systems: one for each value of each axis, and for each combination of the pairs that are a grid."""

from __future__ import annotations

from collections.abc import Iterator

from erag.core.errors import ConfigError
from erag.experiment.config import AxisConfig, ExperimentConfig, SweepConfig, SystemConfig


def point(*settings: tuple[str, float | int | str]) -> str:
    """The name of the system with these values of the axes."""
    return ", ".join(f"{axis} = {value}" for axis, value in settings)


def resolved(config: ExperimentConfig) -> ExperimentConfig:
    """The experiment with every system written out: those of its sweep beside its own, common overrides in each.

    Raises ConfigError for an axis that is not there.
    """
    made = dict(_systems(config.sweep)) if config.sweep is not None else {}
    systems = config.systems | {name: system for name, system in made.items() if name not in config.systems}
    common = config.overrides
    written = {n: s.model_copy(update={"overrides": (*common, *s.overrides)}) for n, s in systems.items()}
    return config.model_copy(update={"systems": written, "overrides": ()})


def _systems(sweep: SweepConfig) -> Iterator[tuple[str, SystemConfig]]:
    for name, axis in sweep.axes.items():
        for value in axis.values:
            yield point((name, value)), _with(sweep.base, (axis, value))
    for a, b in sweep.grid:
        first, second = _axis(sweep, a), _axis(sweep, b)
        for x in first.values:
            for y in second.values:
                yield point((a, x), (b, y)), _with(sweep.base, (first, x), (second, y))


def _axis(sweep: SweepConfig, name: str) -> AxisConfig:
    if name not in sweep.axes:
        raise ConfigError(f"no axis {name!r}", where="sweep.grid", allowed=", ".join(sweep.axes))
    return sweep.axes[name]


def _with(base: SystemConfig, *settings: tuple[AxisConfig, float | int | str]) -> SystemConfig:
    overrides = tuple(f"{axis.path}={value}" for axis, value in settings)
    return base.model_copy(update={"overrides": (*base.overrides, *overrides)})
