"""Simulated worlds: a folder each, with images, ground truth of every view, and questions that follow from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from erag.core.errors import InputError
from erag.data.jsonl import OBSERVATIONS
from erag.data.registry import read
from erag.evaluate.dataset import Dataset, Environment, Question, questions, required
from erag.evaluate.truth import Truths
from erag.evaluate.truthfiles import object_nodes, read_truth

NAME = "simulated"
TRUTH, QUERIES = "truth", "queries.jsonl"


def load(root: Path, queries: Path | None) -> Dataset:
    """Every world below `root`, as `erag sim build` writes it, in the order of the names.

    A world is a folder with `observations.jsonl` whose truth lies in `ROOT/truth/NAME.jsonl`, or beside it in
    `truth.jsonl`. Questions are those of `queries` (else of `ROOT/queries.jsonl`) that state its name as `environment`,
    or its own `queries.jsonl`. What the truth states as `split` holds, else `test`. Raises InputError where there is no
    world.
    """
    required(root, "a folder of simulated worlds")
    worlds = sorted(_worlds(root), key=lambda found: found[0].name)
    if not worlds:
        what = f"no folder in it has {OBSERVATIONS} and a {TRUTH} file"
        raise InputError(what, where=str(root), repair="erag sim build")
    return Dataset(NAME, tuple(_environment(*found, queries or root / QUERIES) for found in worlds))


def _worlds(root: Path) -> Iterator[tuple[Path, Path]]:
    """Folders of worlds with their truth files; hidden folders are work in progress."""
    for observations in root.rglob(OBSERVATIONS):
        world = observations.parent
        if any(part.startswith(".") for part in world.relative_to(root).parts):
            continue
        places = (root / TRUTH / f"{world.name}.jsonl", world / f"{TRUTH}.jsonl")
        yield from ((world, path) for path in places[: 1 if places[0].is_file() else 2] if path.is_file())


def _environment(world: Path, truth: Path, shared: Path) -> Environment:
    own = world / QUERIES
    asked = questions(own) if own.is_file() else questions(shared, {"environment": world.name})
    known, nodes = read_truth(truth, world), read(world).observations
    images = {o.id: world / o.image for o in nodes if o.image is not None}
    seen = {n: replace(t, image=t.image or images.get(n)) for n, t in known.nodes.items()}
    found = object_nodes(nodes) | seen
    return Environment(world.name, world, tuple(map(_targeted, asked)), Truths(found), split=known.split or "test")


def _targeted(question: Question) -> Question:
    """The simulator joins the classes that satisfy a question by `or`."""
    if question.targets is None:
        return question
    return replace(question, targets=frozenset(part for target in question.targets for part in target.split(" or ")))
