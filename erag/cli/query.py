"""The `query` command: one question, or a file of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import AsJson, Config, MemoryPath, Overrides, Preset

if TYPE_CHECKING:
    from erag.core.types import SensorWish
    from erag.data.contract import Result
    from erag.pipeline.query import Asker
    from erag.retrieve.config import Form


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(query)


def query(
    memory: MemoryPath,
    text: Annotated[str | None, typer.Argument(metavar='"TEXT"', help="the question")] = None,
    at: Annotated[str | None, typer.Option(metavar="X,Y[,Z]", help="the robot's position in the map's frame")] = None,
    at_node: Annotated[str | None, typer.Option(metavar="ID", help="the robot's position: at a node")] = None,
    sensor: Annotated[list[str] | None, typer.Option(metavar="NAME=low|high|MIN:MAX", help="a sensor wish")] = None,
    since: Annotated[str | None, typer.Option(metavar="T", help="observed at or after this time")] = None,
    until: Annotated[str | None, typer.Option(metavar="T", help="observed before this time")] = None,
    hours: Annotated[
        str | None, typer.Option(metavar="FROM:TO", help="observed in these hours of the day, UTC")
    ] = None,
    now: Annotated[
        str | None, typer.Option(metavar="T", help="what times are relative to; else the newest view")
    ] = None,
    prefer: Annotated[
        str | None,
        typer.Option(
            metavar="near|balanced|best|0..1", help="with a position: the nearest that will do … the best anywhere"
        ),
    ] = None,
    top: Annotated[int, typer.Option(min=1, help="how many hits")] = 5,
    kind: Annotated[str | None, typer.Option(help="find or explain; decided by the system when absent")] = None,
    json_: AsJson = False,
    queries: Annotated[Path | None, typer.Option(metavar="Q.jsonl", help="a file of questions")] = None,
    where: Annotated[list[str] | None, typer.Option(metavar="KEY=VALUE", help="only these lines of the file")] = None,
    out: Annotated[Path | None, typer.Option(metavar="RUN.jsonl", help="where the file's results go")] = None,
    preset: Preset = "tiny",
    config: Config = None,
    overrides: Overrides = None,
) -> None:
    """Ask a built memory."""
    from erag.lm.weights import default_store
    from erag.pipeline.config import load_config
    from erag.pipeline.query import Asker

    one = {"TEXT": text, "--at": at, "--at-node": at_node, "--sensor": sensor, "--since": since, "--until": until,
           "--hours": hours, "--now": now}  # fmt: skip
    _fit({**one, "--kind": kind, "--json": json_ or None} if queries else {"--where": where, "--out": out}, queries)
    chosen = load_config(preset, config, overrides or ())
    if weight := _weight(prefer, chosen.retrieve.form, located=bool(at or at_node or queries)):
        chosen = load_config(preset, config, [*weight, *(overrides or ())])
    asker = Asker(memory, chosen, default_store())
    if queries is not None:
        _many(asker, queries, _pairs(where or (), "--where"), top, out)
        return
    raw: dict[str, object] = {"id": "query", "query": text, "kind": kind, "since": since, "until": until, "now": now}
    raw["hours"] = None if hours is None else _hours(hours)
    _one(asker, {**raw, "at": _position(asker, at, at_node)}, _wishes(sensor or ()), top, json_)


def _fit(others: Mapping[str, object], queries: Path | None) -> None:
    """Refuse options that would be ignored."""
    from erag.core.errors import ConfigError

    stray = [name for name, value in others.items() if value is not None]
    if stray:
        allowed = "the conditions each line states" if queries else "with --queries Q.jsonl"
        raise ConfigError(f"{' and '.join(stray)} {'with' if queries else 'without'} --queries", allowed=allowed)


def _weight(prefer: str | None, form: Form, *, located: bool) -> list[str]:
    """The override that a preference asks for: none for `balanced`, which is what the configuration says."""
    from erag.core.errors import ConfigError
    from erag.retrieve.config import PREFERENCES

    if prefer is not None and not located:
        raise ConfigError("--prefer without a position", allowed="with --at or --at-node, or with --queries")
    if prefer in (None, "balanced"):
        return []
    try:
        weight = PREFERENCES[prefer][form] if prefer in PREFERENCES else float(prefer)
    except ValueError:
        weight = -1.0
    if not 0 <= weight <= 1:
        allowed = f"{', '.join(PREFERENCES)}, or a number from 0 (best anywhere) to 1 (nearest)"
        raise ConfigError(f"{prefer!r}", where="--prefer", allowed=allowed)
    return [f"retrieve.alpha_rank={weight:g}"]


def _one(asker: Asker, raw: Mapping[str, object], wishes: Mapping[str, SensorWish], top: int, as_json: bool) -> None:
    from dataclasses import replace

    from erag.data.contract import QueryLine, parse_query, result_line

    asked = parse_query(QueryLine(1, "query", raw), top, asker.ground, where="the query")
    result = asker.ask(replace(asked, sensors=wishes))
    if as_json:
        show.out(result_line(result))
    else:
        _print(asker, result)


def _print(asker: Asker, result: Result) -> None:
    if result.answer is not None:
        show.lines(result.answer.text.split("\n"))
        show.lines([result.answer.reason] if result.answer.reason else [])
    texts, row = asker.corpus.texts, asker.corpus.topomap.row
    show.table(
        ("", "node", "score", "semantic", "spatial", "sensor", "description"),
        [
            (i, h.node, *map(show.score, (h.score, h.semantic, h.spatial, h.sensor)), texts[row[h.node]])
            for i, h in enumerate(result.hits, 1)
        ],
        right=("", "score", "semantic", "spatial", "sensor"),
    )  # fmt: skip
    for note in result.notes:
        show.say(f"note: {note}")
    show.say(f"{result.seconds:.3f} s, {result.visited} rows scored")


def _many(asker: Asker, path: Path, where: Mapping[str, str], top: int, out: Path | None) -> None:
    from erag.core.errors import InputError
    from erag.data.contract import read_queries
    from erag.pipeline.query import write_run

    lines = list(read_queries(path, where))
    if not lines:
        chosen = " with " + ", ".join(f"{k}={v}" for k, v in where.items()) if where else ""
        raise InputError(f"no query{chosen}", where=str(path))
    with show.progress_bars(out is not None) as progress:
        results = _counted(asker.ask_lines(lines, top), len(lines), progress)
        failed = write_run(results, out, show.out, asker.path, path)
    if failed:
        show.say(f"{failed} of {len(lines)} queries could not be asked; their lines have an error")
    if failed == len(lines):
        raise typer.Exit(2)


def _counted(results: Iterator[Result], total: int, progress: object) -> Iterator[Result]:
    for done, result in enumerate(results, 1):
        progress("queries", done, total)  # type: ignore[operator]
        yield result


def _position(asker: Asker, at: str | None, at_node: str | None) -> list[float] | None:
    from erag.core.errors import InputError

    if at is not None and at_node is not None:
        raise InputError("both are given", where="--at and --at-node", allowed="one of them")
    if at_node is not None:
        return node_position(asker, at_node)
    if at is None:
        return None
    try:
        return [float(part) for part in at.split(",")]
    except ValueError as error:
        raise InputError(f"{at!r}", where="--at", allowed="X,Y or X,Y,Z") from error


def node_position(asker: Asker, node: str) -> list[float]:
    """The position [x, y, z] of the node that `--at-node` names. Raises InputError for an unknown one."""
    from erag.core.errors import InputError

    rows = asker.corpus.topomap.row
    if node not in rows:
        raise InputError(f"no node {node!r}", where="--at-node", allowed="the id of a node of this memory")
    return list(asker.corpus.topomap.nodes[rows[node]].pose.xyz)


def _pairs(given: Sequence[str], option: str) -> dict[str, str]:
    from erag.core.errors import InputError

    for pair in given:
        if "=" not in pair:
            raise InputError(f"{pair!r}", where=option, allowed="KEY=VALUE")
    pairs = {key: value for key, _, value in (pair.partition("=") for pair in given)}
    if len(pairs) < len(given):
        raise InputError("the same key twice", where=option, allowed="each key once")
    return pairs


def _wishes(given: Sequence[str]) -> dict[str, SensorWish]:
    from erag.data.contract import parse_wish

    return {name: parse_wish(name, _range(value), "--sensor") for name, value in _pairs(given, "--sensor").items()}


def _hours(value: str) -> list[float]:
    from erag.core.errors import InputError

    try:
        first, last = (float(part) for part in value.split(":"))
    except ValueError as error:
        raise InputError(f"{value!r}", where="--hours", allowed="FROM:TO in hours, such as 6:12 or 22:5") from error
    return [first, last]


def _range(value: str) -> object:
    low, colon, high = value.partition(":")
    if not colon:
        return value
    try:
        return [float(low), float(high)]
    except ValueError:
        return value
