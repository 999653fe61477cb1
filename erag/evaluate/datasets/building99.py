"""building99: an office of 257 named objects and 253 drone poses with path edges, from the AirSim simulator."""

from __future__ import annotations

from pathlib import Path

from erag.core.errors import InputError
from erag.evaluate.dataset import Dataset, Environment, questions, required
from erag.evaluate.truthfiles import names_as_truth

NAME = "building99"
MAP = "semantic_forest_gpt.gml"


def load(root: Path, queries: Path | None) -> Dataset:
    """The map in the folder `root` and those questions of `queries` with its name; an object's truth is its class."""
    if queries is None:
        raise InputError("brings no questions of its own", where=f"data set {NAME}", allowed="queries: Q.jsonl")
    source = required(root / MAP, "the authors' AirSim graph")
    asked = questions(queries, {"environment": NAME})
    environment = Environment(NAME, source, asked, names_as_truth(source), split="dev")
    return Dataset(NAME, (environment,), ("judges read the object names that the memory was given",))
