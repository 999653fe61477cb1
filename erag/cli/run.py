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
    estimate: Annotated[
        bool, typer.Option("--estimate", help="only say what is still to be done, and how long that takes")
    ] = False,
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
    made = read_experiment(config, overrides or [])
    if estimate:
        _estimate(made, folder)
        return
    _run(made, folder, tables_only, again or [], wandb)
    if folder.parent == EXPERIMENTS:
        joined(EXPERIMENTS)


def _estimate(config: ExperimentConfig, folder: Path) -> None:
    from erag.experiment.run import Experiment
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        found = Experiment(config, folder, default_store(), progress).estimate()
    rows = [
        (one.what, f"{one.count:,}", "unknown" if one.seconds is None else f"{one.seconds / 60:.1f}") for one in found
    ]
    known = sum(one.seconds for one in found if one.seconds is not None)
    show.table(
        ("what", "how many", "minutes"), [*rows, ("all that is known", "", f"{known / 60:.1f}")], right=("how many",)
    )


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
