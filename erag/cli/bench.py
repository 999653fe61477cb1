"""The `bench` command: measurements that compare alternatives within one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from erag.cli import show
from erag.cli.options import Overrides

if TYPE_CHECKING:
    from erag.bench import config as kinds


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(bench)


def bench(
    config: Annotated[Path, typer.Option("--config", metavar="C.yaml", help="a benchmark (configs/bench)")],
    overrides: Overrides = None,
) -> None:
    """Run a benchmark and print its table."""
    from erag.bench import config as kinds
    from erag.pipeline.config import apply_override, read_yaml, validate

    raw = read_yaml(config)
    for override in overrides or ():
        apply_override(raw, override)
    chosen = validate(kinds.BenchConfig, raw, str(config)).root
    _RUN[chosen.kind](chosen)


def _aware(config: kinds.AwareBench) -> None:
    from erag.bench.aware import missed, run, table
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        scores = list(run(config, default_store(), progress))
    show.table(("task", "measure", "n", "mean", "95 %"), table(scores), right=("n",))
    show.lines(missed(scores))


def _retrieval(config: kinds.RetrievalBench) -> None:
    from erag.bench.retrieval import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.table(
        ("retriever", "kind", "n", "P@1", "P@5", "ms", "rows scored"),
        [(n, s.kind, s.queries, s.p1, s.p5, f"{s.seconds * 1000:.0f}", f"{s.visited:.0f}") for n, s in rows],
        right=("n", "ms"),
    )


def _selection(config: kinds.SelectionBench) -> None:
    from erag.bench.selection import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.out(f"{rows[0].decisions} decisions among {config.cards} cards; chance {1 / config.cards:.2f}")
    show.table(
        ("selector", "right", "diverted by an order", "s a decision", "prompts", "tokens read"),
        [(s.selector, s.right, s.diverted, f"{s.seconds:.4f}", f"{s.prompts:.1f}", f"{s.tokens:,.0f}") for s in rows],
        right=("s a decision", "prompts", "tokens read"),
    )


def _answers(config: kinds.AnswersBench) -> None:
    from erag.bench.answers import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.table(
        ("preset", "queries", "valid", "waypoints on the map", "refused", "median s", "95 % s", "calls a query"),
        [
            (s.preset, s.queries, f"{s.valid:.1%}", f"{s.on_map:.1%}", s.refused, f"{s.median:.3f}", f"{s.p95:.3f}",
             ", ".join(f"{role} {n:.2f}" for role, n in s.calls.items()))
            for s in rows
        ],
        right=("queries", "refused", "median s", "95 % s"),
    )  # fmt: skip
    show.lines(f"{s.preset}: {n:,} {event}" for s in rows for event, n in sorted(s.events.items()))


def _throughput(config: kinds.ThroughputBench) -> None:
    from erag.bench.lm import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    plain = rows[0]
    show.table(
        ("engine", "prompts", "read tok/s", "× plain", "written tok/s", "× plain "),
        [
            (s.engine, s.prompts, f"{s.prefill:,.0f}", f"{s.prefill / plain.prefill:.1f}", f"{s.decode:,.0f}",
             f"{s.decode / plain.decode:.1f}")
            for s in rows
        ],
        right=("prompts", "read tok/s", "× plain", "written tok/s"),
    )  # fmt: skip


def _building(config: kinds.BuildBench) -> None:
    from erag.bench.building import run

    rows = []
    for row in run(config, config.folder):
        show.say(f"{row.variant}: {row.total:.1f} s")
        rows.append(row)
    stages = list(dict.fromkeys(stage for row in rows for stage in row.seconds))
    show.table(
        ("variant", *stages, "total s", "again s", "peak MB", "clusters", "tokens read", "written", "composed"),
        [
            (s.variant, *(f"{s.seconds.get(stage, 0):.1f}" for stage in stages), f"{s.total:.1f}", f"{s.again:.1f}",
             f"{s.peak_mb:,.0f}", s.clusters, f"{s.tokens_read:,}", f"{s.tokens_written:,}", s.composed)
            for s in rows
        ],
        right=(*stages, "total s", "again s", "peak MB", "clusters", "tokens read", "written"),
    )  # fmt: skip
    show.lines(f"{s.variant}: {line}" for s in rows for line in s.quality)


def _clustering(config: kinds.ClusteringBench) -> None:
    from erag.bench.clustering import columns, run

    rows = []
    for row in run(config.sizes, config.seed):
        show.say(f"{row.nodes} nodes, {row.method}: {row.seconds:.1f} s")
        rows.append(row)
    show.table(*columns(rows))


def _scaling(config: kinds.ScalingBench) -> None:
    from erag.bench.scaling import columns, plotted, run
    from erag.lm.weights import default_store

    rows = []
    for row in run(config, default_store()):
        show.say(f"{row.nodes} nodes, {row.retriever}: {1000 * row.median:.1f} ms")
        rows.append(row)
    show.table(*columns(rows))
    show.out(f"plot: {config.plot}" if plotted(rows, config.plot) else "no plot: matplotlib is not installed")


def _location(config: kinds.LocationBench) -> None:
    from erag.bench.location import plotted, run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.table(
        ("form", "weight of location", "kind", "n", "P@1", "way / R", "P·NI"),
        [(s.form, s.weight, s.kind, s.questions, s.right, s.path, s.near) for s in rows],
        right=("n",),
    )
    show.out(f"plot: {config.plot}" if plotted(rows, config.plot) else "no plot: matplotlib is not installed")


def _captions(config: kinds.CaptionsBench) -> None:
    from erag.bench.captions import run
    from erag.lm.weights import default_store

    with show.progress_bars() as progress:
        rows = list(run(config, default_store(), progress))
    show.table(
        ("captioner", "images", "SS", "generic text", "other images", "things named", "images/s"),
        [(s.captioner, s.images, s.ss, s.generic, s.others, s.coverage, f"{s.rate:.1f}") for s in rows],
        right=("images", "images/s"),
    )
    if judged := [(s.captioner, s.objects) for s in rows if s.objects is not None]:
        show.table(
            ("captioner", "images", "object precision", "recall", "F1", "mean F1 of classes", "place"),
            [(n, o.images, o.precision, o.recall, o.f1, f"{o.macro_f1:.2f}", o.place) for n, o in judged],
            right=("images", "mean F1 of classes"),
        )
    for s in rows:
        show.lines(f"{s.captioner}: no caption: {image.line()}" for image in s.bad)
        for case in s.worst:
            show.out(f"{s.captioner}, {case.node}: SS {case.ss:.2f} (generic {case.generic:.2f})")
            show.lines((f"  said:      {case.said}", f"  reference: {case.reference}"))


_RUN: Mapping[str, Callable[[Any], None]] = {
    "aware": _aware,
    "retrieval": _retrieval,
    "selection": _selection,
    "answers": _answers,
    "throughput": _throughput,
    "build": _building,
    "clustering": _clustering,
    "captions": _captions,
    "scaling": _scaling,
    "location": _location,
}
