"""Commands that make, change and show memory files: ingest, build, remove, inspect, diff, export."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from erag.cli import show
from erag.cli.options import AsJson, Config, MemoryPath, Overrides, Preset

SHOWN_ISSUES = 20


def register(app: typer.Typer) -> None:
    """Add this module's commands to the command line."""
    for command in (ingest, build, remove, inspect, diff, export):
        app.command()(command)


def ingest(
    source: Annotated[Path, typer.Argument(help="a file or folder of observations")],
    out: Annotated[Path, typer.Option("--out", metavar="M.erag", help="the memory; added to when it exists")],
    reader: Annotated[str, typer.Option(help="auto, or the format: gml, coex, jsonl")] = "auto",
    id_prefix: Annotated[str, typer.Option(help="put before every id, to tell two sources apart")] = "",
    strict: Annotated[bool, typer.Option(help="fail, changing nothing, when the source has any issue")] = False,
) -> None:
    """Read observations into a memory file."""
    from erag.pipeline import ingest as step

    report = step.ingest(source, out, reader, id_prefix, strict=strict)
    reading, counts = report.reading, report.counts
    show.out(
        f"{reading.source}: {counts.added} added, {counts.replaced} replaced, {counts.unchanged} unchanged; "
        f"{report.total} observations in {out} ({reading.frame}); "
        f"{len(reading.edges)} edges and {len(reading.clusters)} clusters stated by the source"
    )
    show.lines(f"note: {note}" for note in reading.notes)
    for issue in reading.issues[:SHOWN_ISSUES]:
        show.say(f"{issue.where}: {issue.what}: {issue.action}")
    if reading.issues:
        more = len(reading.issues) - SHOWN_ISSUES
        rest = f", {more} more in `erag inspect {out} --issues`" if more > 0 else ""
        show.say(f"{len(reading.issues)} issues{rest}")


def build(
    memory: MemoryPath,
    forest: Annotated[str, typer.Option(help="cluster, or given: the clusters stated by the source")] = "cluster",
    quarantine: Annotated[
        Path | None, typer.Option(metavar="DIR", help="move images that cannot be used to this folder")
    ] = None,
    preset: Preset = "tiny",
    config: Config = None,
    overrides: Overrides = None,
) -> None:
    """Caption, map, embed and cluster the observations of a memory."""
    from erag.core.errors import ConfigError
    from erag.lm.weights import default_store
    from erag.memory.file import MemoryFile
    from erag.pipeline import build as step
    from erag.pipeline.config import load_config

    if forest not in ("cluster", "given"):
        raise ConfigError(f"{forest!r}", where="--forest", allowed="cluster, given")
    settings = load_config(preset, config, overrides or ())
    with MemoryFile.writing(memory, "erag build") as file, show.progress_bars() as progress:
        report = step.build(
            file, settings, default_store(), given=forest == "given", quarantine=quarantine, progress=progress
        )
    show.lines(report.lines)
    if report.moved:
        show.say(f"{len(report.moved)} images moved to {quarantine}")
    stages = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in report.seconds.items())
    show.say(stages or f"{memory}: nothing to do")


def remove(
    memory: MemoryPath,
    ids: Annotated[list[str], typer.Argument(metavar="ID…", help="ids of nodes")],
) -> None:
    """Take nodes out of a memory: no hits from now on, gone from the map at the next build."""
    from erag.memory.file import MemoryFile

    with MemoryFile.writing(memory, "erag remove") as file:
        count = file.observations.remove(ids)
    show.out(f"{count} removed; to take them off the map too: erag build {memory}")


def inspect(
    memory: MemoryPath,
    issues: Annotated[bool, typer.Option("--issues", help="list every issue of the sources")] = False,
    json_: AsJson = False,
) -> None:
    """Show what a memory holds."""
    from erag.memory.file import MemoryFile
    from erag.memory.inspect import inspect as look

    with MemoryFile.reading(memory) as file:
        found = look(file)
    if json_:
        show.out(json.dumps(found.record(), ensure_ascii=False, indent=2))
        return
    show.lines(found.lines())
    if issues:
        show.lines(f"{i.where}: {i.what}: {i.action}" for i in found.issues)


def diff(
    a: Annotated[Path, typer.Argument(metavar="A.erag")],
    b: Annotated[Path, typer.Argument(metavar="B.erag")],
    exit_code: Annotated[bool, typer.Option("--exit-code", help="exit with 1 where they differ")] = False,
) -> None:
    """Compare two memories by what they hold."""
    from erag.memory.diff import diff as compare
    from erag.memory.file import MemoryFile

    with MemoryFile.reading(a) as left, MemoryFile.reading(b) as right:
        parts = compare(left, right)
    show.lines(part.line() for part in parts)
    if not parts:
        show.out("no difference")
    elif exit_code:
        raise typer.Exit(1)


def export(
    memory: MemoryPath,
    out: Annotated[Path, typer.Option("--out", help="the file, or for jsonl the folder, to write")],
    format_: Annotated[str, typer.Option("--format", help="gml, geojson or jsonl")] = "gml",
) -> None:
    """Write map and forest for other tools."""
    from erag.pipeline.export import export as write

    show.out(write(memory, out, format_))
