"""An experiment read from its file; a panel that several experiments share is a file of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from erag.experiment.config import ExperimentConfig
from erag.pipeline.config import apply_override, read_yaml, validate


def read_experiment(path: Path, overrides: Sequence[str] = ()) -> ExperimentConfig:
    """The experiment of a file, with `path=value` overrides; `panel: FILE` names a panel beside it.

    Raises ConfigError for anything that is no experiment.
    """
    raw = read_yaml(path)
    if isinstance(raw.get("panel"), str):
        raw["panel"] = read_yaml(path.parent / raw["panel"])
    for override in overrides:
        apply_override(raw, override)
    return validate(ExperimentConfig, raw, str(path))
