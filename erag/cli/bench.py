"""The `bench` command: measurements that compare alternatives within one run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erag.cli import show
from erag.cli.options import Overrides

if TYPE_CHECKING:
    from erag.bench.config import ClusteringBench, RetrievalBench


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(bench)


def bench(
    config: Annotated[Path, typer.Option("--config", metavar="C.yaml", help="a benchmark (configs/bench)")],
    overrides: Overrides = None,
) -> None:
    """Run a benchmark and print its table."""
    from erag.bench.config import BenchConfig, RetrievalBench
    from erag.pipeline.config import apply_override, read_yaml, validate

    raw = read_yaml(config)
    for override in overrides or ():
        apply_override(raw, override)
    chosen = validate(BenchConfig, raw, str(config)).root
    if isinstance(chosen, RetrievalBench):
        _retrieval(chosen)
    else:
        _clustering(chosen)


def _retrieval(config: RetrievalBench) -> None:
    from erag.bench.retrieval import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.table(
        ("retriever", "kind", "n", "P@1", "P@5", "ms", "rows scored"),
        [(n, s.kind, s.queries, s.p1, s.p5, f"{s.seconds * 1000:.0f}", f"{s.visited:.0f}") for n, s in rows],
        right=("n", "ms"),
    )


def _clustering(config: ClusteringBench) -> None:
    from erag.bench.clustering import columns, run

    rows = []
    for row in run(config.sizes, config.seed):
        show.say(f"{row.nodes} nodes, {row.method}: {row.seconds:.1f} s")
        rows.append(row)
    show.table(*columns(rows))
