"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MemoryPath = Annotated[Path, typer.Argument(metavar="M.erag", help="a memory file")]
Preset = Annotated[str, typer.Option("--preset", help="a shipped configuration (configs/presets)")]
Config = Annotated[Path | None, typer.Option("--config", metavar="C.yaml", help="a configuration file instead")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="change one value, such as forest.alpha=0.5")
]
AsJson = Annotated[bool, typer.Option("--json", help="results as JSON, no progress")]
