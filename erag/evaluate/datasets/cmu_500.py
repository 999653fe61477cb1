"""cmu_500: 3,313 street-view nodes around a campus, with captions by a vision-language model and no images."""

from __future__ import annotations

from pathlib import Path

from erag.core.errors import InputError
from erag.evaluate.dataset import Dataset, Environment, questions, required
from erag.evaluate.truthfiles import captions_as_truth

NAME = "cmu_500"
MAP, FOREST = "topological_map.gml", "semantic_forest_gpt4.gml"


def load(root: Path, queries: Path | None) -> Dataset:
    """The map in the folder `root` (the given forest lies beside it) and those of `queries` with its name."""
    if queries is None:
        raise InputError("brings no questions of its own", where=f"data set {NAME}", allowed="queries: Q.jsonl")
    source = required(root / MAP, "the authors' street-view graph")
    asked = questions(queries, {"environment": NAME})
    environment = Environment(NAME, source, asked, captions_as_truth(source), split="dev")
    return Dataset(NAME, (environment,), ("judges read the captions that the memory was given: there is nothing else",))
