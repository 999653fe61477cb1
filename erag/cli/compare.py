"""The `compare` command: backends beside each other, role by role."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(compare)


def compare(
    config: Annotated[Path, typer.Option("--config", metavar="C.yaml", help="a comparison (configs/compare)")],
    overrides: Overrides = None,
) -> None:
    """Measure what each backend loses in each role, and what to deploy. Interrupted, it goes on where it was."""
    from erag.compare.config import CompareConfig
    from erag.compare.page import COLUMNS, cells, title
    from erag.compare.run import compare as run
    from erag.lm.weights import default_store
    from erag.pipeline.config import apply_override, read_yaml, validate

    raw = read_yaml(config)
    for override in overrides or ():
        apply_override(raw, override)
    settings = validate(CompareConfig, raw, str(config))
    rows = run(settings, default_store(), show.say)
    for trial in dict.fromkeys(row.trial for row in rows):
        found = [row for row in rows if row.trial == trial]
        show.out(title(found))
        show.table(COLUMNS, [cells(row) for row in found], right=("s", "tokens", "MB", "file"))
    show.out(f"the page, with what to deploy in how much memory: {settings.out / 'report.md'}")
