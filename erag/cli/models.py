"""`erag models`: list, pull, import, merge, verify and remove model files."""

from __future__ import annotations

import enum
import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.core.errors import ConfigError, InputError

if TYPE_CHECKING:
    import rich.progress

    from erag.lm.llamacpp.config import Format
    from erag.lm.weights.fetch import Pulled
    from erag.lm.weights.progress import Progress
    from erag.lm.weights.store import ModelStore

app = typer.Typer(no_args_is_help=True, help="Model files: list, pull, import, merge, verify, remove.")


class Preset(enum.StrEnum):
    """The models that a preset of `erag` uses."""

    TINY = "tiny"
    STANDARD = "standard"
    PAPER = "paper"


Files = Annotated[
    Path | None,
    typer.Option(
        "--files", metavar="DIR", show_default=False, help="Keep the model files here instead of in the usual folder."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, and no progress.")]
Names = Annotated[
    list[str] | None,
    typer.Argument(metavar="[NAME]...", help="Ids, as `erag models list` shows them.", show_default=False),
]


@app.command("list")
def list_models(files: Files = None, as_json: AsJson = False) -> None:
    """Show every model: roles, size, licence, and whether its files are here and verified."""
    store = _store(files)
    rows = [(manifest, store.state(manifest.id)) for manifest in store.all()]
    if as_json:
        _print_json(
            [
                {
                    "id": m.id,
                    "title": m.title,
                    "kind": m.kind,
                    "roles": m.roles,
                    "licence": m.licence,
                    "bytes": m.bytes,
                    "ram_mb": m.ram_mb,
                    "presets": m.presets,
                    "state": state,
                    "path": str(store.location(m.id)),
                }
                for m, state in rows
            ]
        )
        return
    _print_table(
        ("id", "roles", "size", "licence", "state"),
        [(m.id, ", ".join(m.roles), _size(m.bytes), m.licence, state) for m, state in rows],
    )


@app.command()
def pull(
    names: Names = None,
    preset: Annotated[Preset | None, typer.Option(help="All models of a preset.", show_default=False)] = None,
    files: Files = None,
    as_json: AsJson = False,
) -> None:
    """Download models and verify them. Interrupted, it goes on where it was; done, it does nothing."""
    from erag.lm.weights import fetch

    store = _store(files)
    wanted = _ids(store, names, [m.id for m in store.all() if preset is not None and preset.value in m.presets])
    if not wanted:
        raise ConfigError(
            "name a model or a preset",
            allowed=", ".join(m.id for m in store.all()),
            repair="erag models pull --preset tiny",
        )
    done: list[Pulled] = []
    with _progress(quiet=as_json) as progress:
        for model in wanted:
            done.append(pulled := fetch.pull(store, model, progress=progress))
            for refusal in pulled.refused:
                typer.echo(f"{model}: {refusal}", err=True)
            if not as_json:
                typer.echo(f"{model}: {_outcome(pulled)}")
    if as_json:
        _print_json(
            [
                {
                    "id": p.id,
                    "path": str(p.path),
                    "source": p.source,
                    "bytes": p.bytes,
                    "seconds": round(p.seconds, 2),
                    "refused": p.refused,
                }
                for p in done
            ]
        )


@app.command("import")
def import_model(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="A model file, or the folder of a folder model.")],
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="ID", show_default=False, help="The model it has to be; else its sha256 tells."),
    ] = None,
    files: Files = None,
    as_json: AsJson = False,
) -> None:
    """Take in a model file that is already on this machine; its sha256 decides which model it is."""
    from erag.lm.weights.intake import take_in

    with _progress(quiet=as_json) as progress:
        taken = take_in(_store(files), source, name, progress)
    if as_json:
        _print_json({"id": taken.id, "path": str(taken.path), "how": taken.how})
    else:
        typer.echo(f"{taken.id}: {'already ' if taken.how == 'present' else ''}{taken.how}, verified, {taken.path}")


class Form(enum.StrEnum):
    """The GGUF formats of a merged model."""

    F16 = "f16"
    Q8_0 = "q8_0"
    Q6_K = "q6_k"
    Q5_K_M = "q5_k_m"
    Q4_K_M = "q4_k_m"
    Q4_0 = "q4_0"
    Q3_K_M = "q3_k_m"
    Q2_K = "q2_k"


@app.command()
def merge(
    adapter: Annotated[
        Path,
        typer.Argument(metavar="ADAPTER", help="A file of `erag distil` (kind: lora), or the name of a shipped one."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="where files and manifests are written")],
    form: Annotated[list[Form] | None, typer.Option(help="GGUF formats; all but f16 need llama.cpp.")] = None,
    files: Files = None,
) -> None:
    """Add an adapter to its model and write the result as GGUF, with manifests by which `import` takes it in."""
    from erag.core.cores import cores
    from erag.lm.merging import WHOLE, merged

    forms: list[Format] = [one.value for one in form or ()] or [WHOLE]
    made = merged(adapter, forms, _store(files), out, threads=cores())
    for manifest in made.values():
        path = out / "files" / manifest.id / manifest.files[0].path
        typer.echo(f"{manifest.id}: {_size(manifest.bytes)}, {path}, {out / 'manifests' / manifest.id}.yaml")


@app.command()
def verify(names: Names = None, files: Files = None, as_json: AsJson = False) -> None:
    """Hash model files again. Exit code 2 when one is wrong, or when one that was named is missing."""
    store = _store(files)
    wanted = _ids(store, names, []) or [manifest.id for manifest in store.all()]
    with _progress(quiet=as_json) as progress:
        checks = [store.check(model, anew=True, progress=progress) for model in wanted]
    if as_json:
        _print_json([{"id": c.id, "state": c.state, "problems": c.problems} for c in checks])
    else:
        _print_table(("id", "state", "what"), [(c.id, c.state, c.problems) for c in checks])
    if any(c.state == "wrong" or (names and c.state == "missing") for c in checks):
        raise typer.Exit(2)


@app.command("rm")
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Ids of models.")],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    files: Files = None,
) -> None:
    """Remove the files of models. Only files of the manifest go, and what an interrupted pull left."""
    store = _store(files)
    wanted = _ids(store, names, [])
    if not yes and not _confirmed(f"Remove the files of {', '.join(wanted)}?"):
        typer.echo("nothing removed")
        return
    for model in wanted:
        freed = store.remove(model)
        typer.echo(f"{model}: removed, {_size(freed)} freed" if freed else f"{model}: was not here")


def _store(files: Path | None) -> ModelStore:
    from erag.lm.weights.store import default_store

    return default_store(files)


def _ids(store: ModelStore, names: list[str] | None, more: Iterable[str]) -> list[str]:
    """Ids once each, in the order given. Raises ModelError for one that is unknown, before anything is done."""
    return list(dict.fromkeys(store.manifest(name).id for name in (*(names or ()), *more)))


def _confirmed(question: str) -> bool:
    try:
        return typer.confirm(question, err=True)
    except typer.Abort as error:
        raise InputError("nobody answered, nothing was removed", repair="the same command with --yes") from error


def _outcome(pulled: Pulled) -> str:
    if pulled.source is None:
        return f"already present and verified, {pulled.path}"
    rate = pulled.bytes / max(pulled.seconds, 1e-3)
    return (
        f"{_size(pulled.bytes)} from {pulled.source} in {pulled.seconds:.1f} s ({_size(int(rate))}/s), "
        f"verified, {pulled.path}"
    )


def _size(size: int | None) -> str:
    if size is None:
        return "?"
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= scale:
            return f"{size / scale:.3g} {unit}"
    return f"{size} B"


def _print_json(value: object) -> None:
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False))


def _print_table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in head:
        table.add_column(title, overflow="fold", no_wrap=title in ("id", "size", "state"))
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(width=None if sys.stdout.isatty() else 80).print(table)


@contextmanager
def _progress(quiet: bool) -> Iterator[Progress]:
    """A bar on stderr, where somebody sees it."""
    from erag.lm.weights.progress import Silent

    if quiet or not sys.stderr.isatty():
        yield Silent()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bars:
        yield _Bar(bars)


class _Bar:
    """One bar at a time: a new one begins with every file or phase, seen by its size or by its starting over."""

    def __init__(self, bars: rich.progress.Progress) -> None:
        self._bars = bars
        self._total: int | None = -1
        self._done = 0

    def update(self, what: str, done: int, total: int | None) -> None:
        if total != self._total or done < self._done // 2:
            for task in self._bars.task_ids:
                self._bars.remove_task(task)
            self._bars.add_task(what, total=total)
            self._total, self._done = total, done
        self._done = max(self._done, done)  # a wheel may be a little larger than what is in it
        self._bars.update(self._bars.task_ids[-1], description=what, completed=self._done)
