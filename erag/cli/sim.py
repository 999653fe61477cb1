"""The `sim` commands: simulated worlds with ground truth, as data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from erag.cli import show
from erag.cli.options import image_size
from erag.core.cores import cores

app = typer.Typer(help="Simulated worlds with images, sensors, exact labels and queries.", no_args_is_help=True)


@app.command()
def build(
    out: Annotated[Path, typer.Option(metavar="DIR", help="the folder of the data set; run again to continue")],
    worlds: Annotated[list[str] | None, typer.Option(help="a world to build (repeat); all by default")] = None,
    setting: Annotated[Literal["e-image", "e-multimodal"], typer.Option(help="without or with NDVI")] = "e-multimodal",
    seed: Annotated[int, typer.Option(min=0, help="another seed furnishes the worlds differently")] = 0,
    size: Annotated[str, typer.Option(metavar="WxH", help="pixels of an image")] = "512x384",
    objects: Annotated[bool, typer.Option("--objects/--no-objects", help="nodes of the objects seen")] = True,
    captions: Annotated[Literal["none", "truth"], typer.Option(help="none, or true ones from the labels")] = "none",
    jobs: Annotated[int | None, typer.Option(min=1, max=256, help="processes that render [default: cores]")] = None,
) -> None:
    """Render worlds into observation folders, GML, ground truth and labelled queries."""
    from erag.sim.extra import require

    require()
    from erag.sim.dataset import Plan
    from erag.sim.dataset import build as build_dataset

    plan = Plan(tuple(worlds or ()), setting, seed, image_size(size), objects=objects, captions=captions)
    with show.progress_bars() as progress:
        build_dataset(out, plan, progress, jobs or cores())
    show.out(f"{len(plan.names)} worlds in {out}: worlds/, gml/, truth/, queries.jsonl")


@app.command(name="list")
def list_worlds() -> None:
    """List the worlds."""
    from erag.sim.scene import scene_heads

    rows = [(h.number, name, h.title, h.setting, h.split, h.robot, len(h.visits)) for name, h in scene_heads()]
    show.table(("no", "world", "what", "setting", "split", "robot", "visits"), rows, right=("no",))


@app.command()
def sheet(
    out: Annotated[Path, typer.Option(metavar="PICTURE.png", help="where the picture is written")],
    split: Annotated[Literal["train", "test"], typer.Option(help="looks of training or of held-out worlds")] = "train",
) -> None:
    """Draw every object class with its name, to be looked at."""
    from erag.sim.extra import require

    require()
    from erag.sim.sheet import class_page

    class_page(split).save(out)
    show.out(f"{out}")
