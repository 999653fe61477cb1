"""A run in Weights & Biases, offline: its configuration, tables, figures and pictures, for who compares runs there."""

from __future__ import annotations

import csv
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from erag.core.errors import ConfigError
from erag.core.tracking import offline_settings
from erag.experiment.config import ExperimentConfig
from erag.experiment.predictions import read_predictions
from erag.experiment.report import Folder

PROJECT = "erag-experiments"


def track(config: ExperimentConfig, folder: Folder) -> Path:
    """Log a finished run; returns where wandb keeps it, to be sent with `wandb sync`. Nothing leaves this machine.

    Raises ConfigError where wandb is not installed.
    """
    if find_spec("wandb") is None:
        raise ConfigError("wandb is not installed", where="--wandb", repair="pip install 'erag[experiment]'")
    import wandb

    run = wandb.init(
        project=PROJECT, name=folder.path.name, dir=str(folder.path), settings=offline_settings(),
        config=config.model_dump(mode="json"), reinit="finish_previous",
    )  # fmt: skip
    try:
        _log(run, wandb, folder)
        return Path(run.dir).parent
    finally:
        run.finish()


def _log(run: Any, wandb: Any, folder: Folder) -> None:
    for cell in json.loads(folder.metrics.read_text(encoding="utf-8")):
        run.summary["/".join(cell[k] for k in ("data", "table", "system", "column"))] = cell["mean"]
    for path in sorted(folder.path.glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            columns, *rows = list(csv.reader(file))
        run.log({f"table/{path.stem}": wandb.Table(columns=columns, data=rows)})
    for path in sorted(folder.path.glob("*.png")):
        run.log({f"picture/{path.stem}": wandb.Image(str(path))})
    _curves(run, folder)


def _curves(run: Any, folder: Folder) -> None:
    """Seconds, rows and tokens of every answer in the order they were asked, a curve a system."""
    predictions = read_predictions(folder.predictions)
    for system in dict.fromkeys(p.system for p in predictions):
        run.define_metric(f"asked/{system}/*", step_metric=f"asked/{system}/number")
    counts: dict[str, int] = {}
    for one in predictions:
        counts[one.system] = counts.get(one.system, 0) + 1
        run.log({
            f"asked/{one.system}/number": counts[one.system], f"asked/{one.system}/seconds": one.seconds,
            f"asked/{one.system}/visited": one.visited, f"asked/{one.system}/tokens": one.tokens_in + one.tokens_out,
        })  # fmt: skip
