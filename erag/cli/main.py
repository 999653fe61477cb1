"""The entry point: commands in, exit code out (0 done, 2 wrong input or configuration, 1 a defect)."""

from __future__ import annotations

import io
import sys

import typer

from erag.cli import bench, compare, demo, distil, doctor, memory, models, quantise, query, records, report, serve, sim
from erag.cli import run as experiments
from erag.cli.show import say
from erag.core.errors import EragError
from erag.lm.offline import forbid_network

INTERRUPTED = 130  # 128 + SIGINT, as shells count

app = typer.Typer(
    name="erag", help="Offline Embodied-RAG: a robot's observations become a memory that can be asked.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip
for module in (memory, query, report, demo, doctor, bench, distil, quantise, compare, serve, experiments):
    module.register(app)
app.add_typer(models.app, name="models")
app.add_typer(sim.app, name="sim")
app.add_typer(records.app, name="records")


def main() -> None:
    """Run the command line and exit."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal that cannot show a sign shows its number
    if sys.argv[1:2] != ["models"]:  # only `models pull` fetches, through pip
        forbid_network()
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """The exit code of a command line; every expected error is one line on stderr."""
    try:
        code = int(app(args=arguments, prog_name="erag", standalone_mode=False) or 0)
    except EragError as error:
        say(f"erag: {error.line()}")
        return 2
    except typer.TyperException as error:  # how the arguments were written
        context = getattr(error, "ctx", None)
        say(f"erag: {error.format_message()}; try: {context.command_path if context else 'erag'} --help")
        return 2
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    if code == INTERRUPTED:
        say("erag: interrupted; what was finished is kept, the same command goes on from there")
    return code


if __name__ == "__main__":
    main()
