"""The `demo` command: the whole way from observations to answers on the sample that comes with the package."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import Preset

if TYPE_CHECKING:
    from erag.pipeline.session import Memory

START = "n01"
QUESTIONS = (
    "Find a bench to sit on",
    "My tyre is flat and I have no tools",
    "Where can I charge an electric car?",
    "What is the vegetation like across the campus?",
)


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(demo)


def demo(
    out: Annotated[Path, typer.Option(help="the folder for the memory and its exports")] = Path("demo-out"),
    preset: Preset = "tiny",
) -> None:
    """Build a memory from the sample and ask it."""
    from erag.core.errors import InputError
    from erag.pipeline.session import open_memory

    if out.exists() and not out.is_dir():
        raise InputError("is not a folder", where=str(out), allowed="--out FOLDER")
    out.mkdir(parents=True, exist_ok=True)
    memory = open_memory(out / "campus.erag", preset)
    _make(memory, out)
    _ask(memory, out / "report.html", preset)
    _score(memory)
    _where_next(memory.path)


def _make(memory: Memory, out: Path) -> None:
    from erag.data.sample import sample_dir
    from erag.pipeline.export import export

    show.out("1. ingest: the observations of a robot on a small campus")
    report = memory.ingest(sample_dir())
    show.out(f"   {report.total} observations, {len(report.reading.edges)} edges")
    show.out("2. build: topological map, embeddings, semantic forest")
    with show.progress_bars() as progress:
        built = memory.build(progress=progress)
    show.lines(f"   {line}" for line in built.lines)
    for format_ in ("gml", "geojson"):
        export(memory.path, out / f"campus.{format_}", format_)
    show.out(f"3. query: asked at {START}, the first place of the drive")


def _ask(memory: Memory, page: Path, preset: str) -> None:
    """Ask the questions from the first place of the drive; print the answers and show them on a page."""
    from erag.report.asking import ask, text_lines
    from erag.report.memory import shown_of
    from erag.report.page import render, write_page

    asker = memory.asker
    asked = list(ask(asker, text_lines(QUESTIONS), at=memory.map.nodes[memory.map.row[START]].pose.xyz))
    for question, answer in ((a.text, a.result.answer) for a in asked):
        show.out(f'   "{question}"')
        if answer is not None:
            show.lines(f"     {line}" for line in (*answer.text.split("\n"), answer.reason))
    made = render(shown_of(asker.path, asker.corpus, asker.notes, preset), asked)
    show.out(f"   {write_page(made, page, asker.path)}")


def _score(memory: Memory) -> None:
    from erag.data.sample import sample_queries
    from erag.evaluate.labelled import evaluate

    show.out("4. the labelled questions of the sample")
    for row in evaluate(memory.asker, sample_queries()):
        show.out(f"   {row.line()}")


def _where_next(path: Path) -> None:
    show.out(f'ask it yourself: erag query {path} "Where can I lock up my bicycle?" --at-node {START}')
