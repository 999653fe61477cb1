"""One page that joins all runs: what each is, its tables, and where it came from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from erag.core.errors import InputError
from erag.core.output import replacing
from erag.experiment.report import DETAILS, Folder

PAGE = "README.md"


def join(root: Path) -> Path:
    """Write `root/README.md` from the pages of the runs in the folders of `root`. Raises InputError for none."""
    runs = sorted(p.parent for p in root.glob(f"*/{PAGE}") if Folder(p.parent).config.is_file())
    if not runs:
        raise InputError("no run in it", where=str(root), repair="erag run --config configs/paper/table2.yaml")
    with replacing(root / PAGE) as file:
        file.write(
            "# Experiments\n\nWritten by `erag run`. How to read the tables: [evaluation](../docs/evaluation.md).\n\n"
        )
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
    """The page of a run down to its details; headings one level down, pictures by path."""
    for line in (run / PAGE).read_text(encoding="utf-8").splitlines():
        if line == f"## {DETAILS}":
            yield f"[{DETAILS}]({run.name}/{PAGE}#{DETAILS.lower()}): tests, other judges, costs, machine."
            return
        if line.startswith("#"):
            yield f"#{line}"
        elif line.startswith("!["):
            yield line.replace("](", f"]({run.name}/", 1)
        else:
            yield line
