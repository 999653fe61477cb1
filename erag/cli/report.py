"""The `report` command: a memory and its answers as one HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import Config, MemoryPath, Overrides, Preset

if TYPE_CHECKING:
    from erag.data.contract import QueryLine
    from erag.pipeline.config import PipelineConfig
    from erag.report.asking import Asked
    from erag.report.memory import Shown


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(report)


def report(
    memory: MemoryPath,
    out: Annotated[Path, typer.Option("--out", metavar="PAGE.html", help="the page to write")],
    queries: Annotated[Path | None, typer.Option(metavar="Q.jsonl", help="a file of questions to show")] = None,
    texts: Annotated[list[str] | None, typer.Option("--ask", metavar="TEXT", help="a question to show")] = None,
    at_node: Annotated[
        str | None, typer.Option(metavar="ID", help="the robot's position, a node, where a question states none")
    ] = None,
    top: Annotated[int, typer.Option(min=1, help="how many hits")] = 5,
    seconds: Annotated[bool, typer.Option(help="say how long answers took; without, the same bytes every time")] = True,
    preset: Preset = "tiny",
    config: Config = None,
    overrides: Overrides = None,
) -> None:
    """Write a memory and its answers as one HTML page that needs no network."""
    from erag.pipeline.config import load_config
    from erag.report.config import ReportConfig
    from erag.report.page import render, write_page

    settings = load_config(preset, config, overrides or ())
    name = config.name if config is not None else preset
    lines = _lines(texts or (), queries)
    if lines:
        shown, asked = _asked(memory, lines, at_node, top, settings, name)
    else:
        shown, asked = _unasked(memory, at_node, name), []
    page = render(shown, asked, ReportConfig(seconds=seconds))
    inputs = [memory, *([queries] if queries is not None else [])]
    show.out(write_page(page, out, *inputs))
    for issue in page.issues:
        show.say(f"{issue.where}: {issue.what}: {issue.action}")


def _lines(texts: Sequence[str], queries: Path | None) -> list[QueryLine]:
    from erag.core.errors import InputError
    from erag.data.contract import read_queries
    from erag.report.asking import text_lines

    read = list(read_queries(queries, {})) if queries is not None else []
    if queries is not None and not read:
        raise InputError("no query", where=str(queries))
    return [*text_lines(texts), *read]


def _asked(
    memory: Path, lines: Sequence[QueryLine], at_node: str | None, top: int, settings: PipelineConfig, preset: str
) -> tuple[Shown, list[Asked]]:
    """The memory and its answers, from one loading."""
    from erag.cli.query import node_position
    from erag.lm.weights import default_store
    from erag.pipeline.query import Asker
    from erag.report.asking import ask
    from erag.report.memory import shown_of

    asker = Asker(memory, settings, default_store())
    at = node_position(asker, at_node) if at_node is not None else None
    asked = []
    with show.progress_bars() as progress:
        for answer in ask(asker, lines, top, at):
            asked.append(answer)
            progress("questions", len(asked), len(lines))
    return shown_of(memory, asker.corpus, asker.notes, preset), asked


def _unasked(memory: Path, at_node: str | None, preset: str) -> Shown:
    from erag.core.errors import ConfigError
    from erag.report.memory import read_shown

    if at_node is not None:
        raise ConfigError("--at-node without a question", allowed="with --ask TEXT or --queries Q.jsonl")
    return read_shown(memory, preset=preset)
