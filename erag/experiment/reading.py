"""An experiment read from its file; a panel that several experiments share is a file of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from erag.experiment.config import ExperimentConfig
from erag.pipeline.config import apply_override, read_yaml, validate


def read_experiment(path: Path, overrides: Sequence[str] = ()) -> ExperimentConfig:
    """The experiment of a file, with `path=value` overrides.

    `panel: {from: FILE, …}` takes over the panel of a file, named from this one's folder; the other keys replace what
    it says. Raises ConfigError for anything that is no experiment.
    """
    raw = read_yaml(path)
    panel = raw.get("panel")
    if isinstance(panel, dict) and "from" in panel:
        shared = read_yaml(path.parent / str(panel.pop("from")))
        raw["panel"] = shared | panel
    for override in overrides:
        apply_override(raw, override)
    return validate(ExperimentConfig, raw, str(path))
