"""The `demo` command: the whole way from pixels to answers in a rendered world, or from texts on the shipped sample."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides, Preset, image_size

if TYPE_CHECKING:
    from erag.data.contract import QueryLine
    from erag.pipeline.session import Memory

WORLD = "campus"  # not among the worlds the student learned from
ONE_MAP = ("map.bridge=true", "map.max_bridge=2")  # two drives through one world meet where they pass the same place
SAMPLE_START = "n01"
SAMPLE_QUESTIONS = (
    "Find a bench to sit on",
    "My tyre is flat and I have no tools",
    "Where can I charge an electric car?",
    "What is the vegetation like across the campus?",
)
ASKED = {"explicit": 2, "implicit": 2, "global": 2}  # how many of the world's own queries are asked, by kind


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(demo)


def demo(
    out: Annotated[Path, typer.Option(help="the folder for the world, the memory and the page")] = Path("demo-out"),
    world: Annotated[str, typer.Option(help="the simulated world, of `erag sim list`")] = WORLD,
    sample: Annotated[bool, typer.Option("--sample", help="the shipped sample instead: texts, no images")] = False,
    size: Annotated[str, typer.Option(metavar="WxH", help="pixels of a rendered image")] = "512x384",
    preset: Preset = "tiny",
    overrides: Overrides = None,
) -> None:
    """Render a world, caption what a robot saw there, build a memory and ask it."""
    from erag.core.errors import InputError
    from erag.pipeline.session import open_memory

    if out.exists() and not out.is_dir():
        raise InputError("is not a folder", where=str(out), allowed="--out FOLDER")
    if sample:
        _sample(open_memory(out / "campus.erag", preset, overrides=overrides or ()), out, preset)
    else:
        drive = open_memory(out / f"{world}-drive.erag", preset, overrides=(*ONE_MAP, *(overrides or ())))
        _world(drive, out, world, size, preset)


def _sample(memory: Memory, out: Path, preset: str) -> None:
    from erag.data.sample import sample_dir, sample_queries
    from erag.report.asking import text_lines

    out.mkdir(parents=True, exist_ok=True)
    show.out("1. ingest: the observations of a robot on a small campus")
    _build(memory, sample_dir(), out, "2. build: topological map, embeddings, semantic forest")
    show.out(f"3. query: asked at {SAMPLE_START}, the first place of the drive")
    _ask(memory, text_lines(SAMPLE_QUESTIONS), SAMPLE_START, out / "report.html", preset)
    show.out("4. the labelled questions of the sample")
    _score(memory, sample_queries(), {})
    show.out(f'ask it yourself: erag query {memory.path} "Where can I lock up my bicycle?" --at-node {SAMPLE_START}')


def _world(memory: Memory, out: Path, world: str, size: str, preset: str) -> None:
    from erag.data.contract import read_queries
    from erag.lm.config import build_backend
    from erag.lm.weights import default_store
    from erag.sim.extra import require

    require()
    build_backend(memory.config.backend, default_store()).fingerprint("caption")  # a missing captioner is told now
    data = out / "world"
    show.out(f"1. render: a robot drives through the simulated world {world!r} and records images, poses, times, NDVI")
    _render(data, world, size)
    words = "2. build: captions from the pixels, topological map, embeddings, semantic forest"
    _build(memory, data / "worlds" / world, out, words)
    start = memory.map.nodes[0].id
    show.out(f"3. query: questions about the world, asked at {start} unless they say where")
    lines = list(_chosen(list(read_queries(data / "queries.jsonl", {"environment": world}))))
    _ask(memory, lines, start, out / "report.html", preset)
    show.out("4. all questions whose answers follow from the world's ground truth")
    _score(memory, data / "queries.jsonl", {"environment": world, "task": "find"})
    show.out(f'ask it yourself: erag query {memory.path} "Where can I lock up my bicycle?" --at-node {start}')


def _render(data: Path, world: str, size: str) -> None:
    from erag.sim.dataset import Plan, build

    pixels = image_size(size)
    with show.progress_bars() as progress:
        build(data, Plan(worlds=(world,), size=pixels, town_size=pixels, objects=False), progress)


def _build(memory: Memory, source: Path, out: Path, words: str) -> None:
    """Ingest and build, and export the map."""
    from erag.pipeline.export import export

    report = memory.ingest(source)
    show.out(f"   {report.total} observations, {len(report.reading.edges)} edges")
    show.out(words)
    with show.progress_bars() as progress:
        built = memory.build(progress=progress)
    show.lines(f"   {line}" for line in built.lines)
    for format_ in ("gml", "geojson"):
        export(memory.path, out / f"{memory.path.stem}.{format_}", format_)


def _chosen(lines: Sequence[QueryLine]) -> Iterator[QueryLine]:
    """The first answerable queries of each kind, as many as `ASKED` says."""
    for kind, count in ASKED.items():
        tasks = ("describe",) if kind == "global" else ("find",)
        found = [line for line in lines if line.raw and line.raw["kind"] == kind and line.raw["task"] in tasks]
        yield from found[:count]


def _ask(memory: Memory, lines: Sequence[QueryLine], start: str, page: Path, preset: str) -> None:
    """Ask the questions, from `start` where they do not say where; print the answers and show them on a page."""
    from erag.report.asking import ask
    from erag.report.memory import shown_of
    from erag.report.page import render, write_page

    asker = memory.asker
    asked = list(ask(asker, lines, at=memory.map.nodes[memory.map.row[start]].pose.xyz))
    for question, answer in ((a.text, a.result.answer) for a in asked):
        show.out(f'   "{question}"')
        if answer is not None:
            show.lines(f"     {line}" for line in (*answer.text.split("\n"), answer.reason) if line)
    made = render(shown_of(asker.path, asker.corpus, asker.notes, preset), asked)
    show.out(f"   {write_page(made, page, asker.path)}")


def _score(memory: Memory, queries: Path, where: dict[str, str]) -> None:
    from erag.evaluate.labelled import evaluate

    for row in evaluate(memory.asker, queries, where):
        show.out(f"   {row.line()}")
