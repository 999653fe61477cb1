"""The `compare` command: backends beside each other, role by role."""

from __future__ import annotations

import typer


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    del app
