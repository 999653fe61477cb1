"""The `records` commands: call records out of memories, into memories, and from what others' models have said."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer

from erag.cli import show
from erag.cli.options import MemoryPath

app = typer.Typer(help="Call records: export, import, and reference records of cloud models.", no_args_is_help=True)
Out = Annotated[Path, typer.Option("--out", metavar="CALLS.jsonl.gz", help="the file to write")]


@app.command()
def export(
    memory: MemoryPath,
    out: Out,
    role: Annotated[list[str] | None, typer.Option(help="only this role; may be given several times")] = None,
) -> None:
    """Write every recorded model call of a memory."""
    from erag.core.errors import ConfigError
    from erag.lm.roles import ROLES, RoleName
    from erag.pipeline.records import export_records

    if unknown := [r for r in role or () if r not in ROLES]:
        raise ConfigError(f"unknown role {unknown[0]!r}", where="--role", allowed=", ".join(ROLES))
    roles = cast(tuple[RoleName, ...], tuple(role or ROLES))
    show.out(f"{out}: {export_records(memory, out, roles).line()}")


@app.command("import")
def import_(
    memory: MemoryPath, calls: Annotated[Path, typer.Argument(metavar="CALLS.jsonl.gz", help="recorded calls")]
) -> None:
    """Take recorded calls into a memory: its models are then not asked for them again."""
    from erag.pipeline.records import import_records

    moved = import_records(memory, calls)
    show.out(f"{memory}: {moved.line()}; {moved.new:,} of them new")


@app.command()
def reference(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="a map with a forest, or a folder of decisions")],
    out: Out,
    teacher: Annotated[str, typer.Option(help="the model that said it, such as gpt-4o")] = "cloud",
) -> None:
    """Make records of what a cloud model said of a source: its captions, summaries or decisions."""
    from erag.compare.reference import references
    from erag.lm.callfile import write_calls

    found = references(source, teacher)
    write_calls(out, found.records)
    counts = ", ".join(f"{n:,} {role}" for role, n in sorted(found.counts.items()))
    show.out(f"{out}: {counts}")
    show.lines(f"note: {note}" for note in found.notes)
