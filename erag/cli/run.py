"""The `run` command: a whole experiment, its tables anew, or the page that joins all runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides

if TYPE_CHECKING:
    from erag.experiment.config import ExperimentConfig

EXPERIMENTS = Path("experiments")


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(run)


def run(
    config: Annotated[
        Path | None, typer.Option("--config", metavar="C.yaml", help="an experiment (configs/paper)")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="its folder; experiments/<name> by default")] = None,
    tables_only: Annotated[
        bool, typer.Option("--tables-only", help="only tables and pictures, from the answers that are there")
    ] = False,
    again: Annotated[list[str] | None, typer.Option(metavar="SYSTEM", help="ask this system anew")] = None,
    wandb: Annotated[bool, typer.Option("--wandb", help="log to Weights & Biases, offline")] = False,
    join: Annotated[bool, typer.Option("--join", help="only the page that joins all runs")] = False,
    overrides: Overrides = None,
) -> None:
    """Run an experiment; killed at any moment, the same command goes on, and nothing is asked twice."""
    from erag.core.errors import ConfigError
    from erag.experiment.join import join as joined
    from erag.experiment.reading import read_experiment

    if config is None:
        if not join:
            raise ConfigError("no experiment", where="--config", allowed="C.yaml, or --join for the joined page")
        show.out(str(joined(EXPERIMENTS)))
        return
    folder = out or EXPERIMENTS / config.stem
    _run(read_experiment(config, overrides or []), folder, tables_only, again or [], wandb)
    if folder.parent == EXPERIMENTS:
        joined(EXPERIMENTS)


def _run(config: ExperimentConfig, folder: Path, tables_only: bool, again: list[str], wandb: bool) -> None:
    from erag.experiment.run import Experiment
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        experiment = Experiment(config, folder, default_store(), progress)
        experiment.tables() if tables_only else experiment.run(again)
    if wandb:
        from erag.experiment.tracking import track

        show.say(f"wandb: {track(experiment.config, experiment.folder)}")
    show.say(
        f"{experiment.asked_now:,} questions asked now, {experiment.taken_over:,} answers of other runs taken over"
    )
    show.out(str(experiment.folder.page))
