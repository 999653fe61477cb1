"""The `distil` command: training of students."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(distil)


def distil(
    config: Annotated[Path, typer.Option("--config", metavar="C.yaml", help="a student (configs/distil)")],
    overrides: Overrides = None,
) -> None:
    """Train a student and write it with its card. Interrupted, it goes on where it was."""
    from erag.lm.weights import default_store
    from erag.pipeline.config import apply_override, read_yaml, validate
    from erag.study import kinds

    raw = read_yaml(config)
    for override in overrides or ():
        apply_override(raw, override)
    chosen = validate(kinds.AnyDistil, raw, str(config)).root
    with show.progress_bars() as progress:
        report = kinds.run(chosen, default_store(), progress)
    shown = report.table()
    show.table(shown.header, shown.rows, right=shown.right)
    seconds = ", ".join(f"{stage} {taken:.0f} s" for stage, taken in report.seconds.items())
    show.say(f"{report.out} ({report.bytes:,} bytes, card beside it); {seconds}")
