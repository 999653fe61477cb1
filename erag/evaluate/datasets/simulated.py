"""Simulated worlds: a folder each, with images, ground truth of every view, and questions that follow from it."""

from __future__ import annotations

from pathlib import Path

from erag.core.errors import InputError
from erag.data.jsonl import OBSERVATIONS
from erag.evaluate.dataset import Dataset, Environment, questions, required
from erag.evaluate.truthfiles import SPLITS, TRUTH, read_splits, read_truth

NAME = "simulated"
QUERIES = "queries.jsonl"


def load(root: Path, queries: Path | None) -> Dataset:
    """Every world below `root`: a folder with `observations.jsonl` and `truth.jsonl`, in the order of their paths.

    Questions are those of the world's `queries.jsonl`, else those of `queries` (else of `queries.jsonl` in `root`) that
    state its name as `environment`. `splits.json` in `root` maps a world to its split, `test` where it is silent.
    """
    required(root, "a folder of simulated worlds")
    worlds = sorted(p.parent for p in root.rglob(TRUTH) if (p.parent / OBSERVATIONS).is_file())
    if not worlds:
        raise InputError(f"no folder in it has {OBSERVATIONS} and {TRUTH}", where=str(root), repair="erag sim build")
    splits = read_splits(root / SPLITS)
    shared = queries or root / QUERIES
    return Dataset(NAME, tuple(_environment(world, shared, splits.get(world.name, "test")) for world in worlds))


def _environment(world: Path, shared: Path, split: str) -> Environment:
    own = world / QUERIES
    asked = questions(own) if own.is_file() else questions(shared, {"environment": world.name})
    return Environment(world.name, world, asked, read_truth(world), split=split)
