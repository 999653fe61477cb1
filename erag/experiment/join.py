"""One page that joins all runs: what each is, its tables, and where it came from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from erag.core.errors import InputError
from erag.core.output import replacing
from erag.experiment.report import Folder

PAGE = "README.md"
_LINES = 400  # of one run's page that are shown
_LEFT_OUT = (
    "## Tests",
    "## What answers cost",
    "## With other judges",
    "## Made with",
    "## Systems",
)  # not on the joined page


def join(root: Path) -> Path:
    """Write `root/README.md` from the pages of the runs in the folders of `root`. Raises InputError for none."""
    runs = sorted(p.parent for p in root.glob(f"*/{PAGE}") if Folder(p.parent).config.is_file())
    if not runs:
        raise InputError("no run in it", where=str(root), repair="erag run --config configs/paper/table2.yaml")
    with replacing(root / PAGE) as file:
        file.write("# Experiments\n\nEach run's page has its tests, costs, sensitivity to the judges, and machine.\n\n")
        file.writelines(f"* [{run.name}]({run.name}/{PAGE}): {_title(run)}\n" for run in runs)
        for run in runs:
            file.writelines(f"{line}\n" for line in ("", *_short(run)))
    return root / PAGE


def _title(run: Path) -> str:
    page = (run / PAGE).read_text(encoding="utf-8")
    revision = "unknown"
    if Folder(run).facts.is_file():
        revision = str(json.loads(Folder(run).facts.read_text(encoding="utf-8")).get("revision", "unknown"))[:12]
    return f"{page.splitlines()[0].lstrip('# ')} (revision `{revision}`)"


def _short(run: Path) -> Iterator[str]:
    """The page of a run without the sections that only its own page has; headings one level down, pictures by path."""
    kept, shown = 0, True
    for line in (run / PAGE).read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            shown = not line.startswith(_LEFT_OUT)
        if not shown or (kept := kept + 1) > _LINES:
            continue
        if line.startswith("#"):
            yield f"#{line}"
        elif line.startswith("!["):
            yield line.replace("](", f"]({run.name}/", 1)
        else:
            yield line
