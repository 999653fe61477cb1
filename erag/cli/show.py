"""What a person sees: tables on stdout, progress and messages on stderr, nothing but results in a pipe."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import typer

from erag.core.errors import printable
from erag.core.progress import Progress, quiet

MAX_LINE = 100_000  # characters of a line of results


def say(text: str) -> None:
    """A message on stderr."""
    print(printable(text), file=sys.stderr)  # noqa: T201


def out(text: str) -> None:
    """A line of the result on stdout; a reader that has gone away ends the command without an error."""
    try:
        print(text, flush=True)  # noqa: T201
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit from None


def lines(many: Iterable[str]) -> None:
    """Lines of the result on stdout, made printable."""
    for line in many:
        out(printable(line, MAX_LINE))


def table(columns: Sequence[str], rows: Iterable[Sequence[object]], *, right: Sequence[str] = ()) -> None:
    """A table as wide as the terminal; the last column is cut to what is left."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        last = name == columns[-1]
        grid.add_column(
            name,
            justify="right" if name in right else "left",
            no_wrap=not last,
            overflow="ellipsis" if last else "fold",
        )
    for row in rows:
        grid.add_row(*(Text(printable(str(cell))) for cell in row))
    console = Console()
    with console.capture() as drawn:
        (console if console.is_terminal else Console(width=160)).print(grid)
    out(drawn.get().rstrip("\n"))


@contextmanager
def progress_bars(enabled: bool = True) -> Iterator[Progress]:
    """A progress callback drawn as bars with rate and time left; silent where stderr is not a terminal."""
    if not (enabled and sys.stderr.isatty()):
        yield quiet
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description:<10}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bars(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done, total=total)

        yield show


def score(value: float | None) -> str:
    """A score in [0, 1] for a table; a dash where there is none."""
    return "–" if value is None else f"{value:.3f}"
