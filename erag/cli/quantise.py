"""The `quantise` command: models and vectors in fewer bits, and what that costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(quantise)


def quantise(
    config: Annotated[Path, typer.Option("--config", metavar="C.yaml", help="a study (configs/quantise)")],
    overrides: Overrides = None,
) -> None:
    """Make smaller variants of a model or of vectors and measure each. Interrupted, it goes on where it was."""
    from erag.lm.weights import default_store
    from erag.pipeline.config import apply_override, read_yaml, validate
    from erag.study import kinds
    from erag.study.quantconfig import AnyQuantise

    raw = read_yaml(config)
    for override in overrides or ():
        apply_override(raw, override)
    chosen = validate(AnyQuantise, raw, str(config)).root
    with show.progress_bars() as progress:
        shown = kinds.quantise(chosen, default_store(), progress)
    show.table(shown.header, shown.rows, right=shown.right)
    show.say(f"report in {chosen.out}")
