"""Options that several commands share."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.core.errors import InputError

if TYPE_CHECKING:
    from erag.sim.camera import Size

MemoryPath = Annotated[Path, typer.Argument(metavar="M.erag", help="a memory file")]
Preset = Annotated[str, typer.Option("--preset", help="a shipped configuration (configs/presets)")]
Config = Annotated[Path | None, typer.Option("--config", metavar="C.yaml", help="a configuration file instead")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="change one value, such as forest.alpha=0.5")
]
AsJson = Annotated[bool, typer.Option("--json", help="results as JSON, no progress")]

_SIZE = re.compile(r"([0-9]{2,4})x([0-9]{2,4})")


def image_size(text: str) -> Size:
    """The value of `--size`, as in 512x384. Raises InputError."""
    from erag.sim.camera import Size

    match = _SIZE.fullmatch(text)
    if match is None or not (32 <= int(match[1]) <= 2048 and 32 <= int(match[2]) <= 2048):
        raise InputError(f"the size is {text!r}", where="--size", allowed="WxH, each 32 to 2048, such as 512x384")
    return Size(int(match[1]), int(match[2]))
