"""The sample campus that comes with the package: small, labelled, its captions are all that is known of it."""

from __future__ import annotations

from pathlib import Path

from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.dataset import Dataset, Environment, questions
from erag.evaluate.truthfiles import captions_as_truth

NAME = "sample"


def load(root: Path, queries: Path | None) -> Dataset:
    """The campus, whatever `root`, with its own questions or those of `queries`."""
    del root
    asked = questions(queries or sample_queries())
    environment = Environment("campus", sample_dir(), asked, captions_as_truth(sample_dir()), split="dev")
    return Dataset(NAME, (environment,), ("judges read the captions that the memory was given",))
