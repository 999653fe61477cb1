"""The shipped sample: a small campus in our observation format, with labelled queries."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from erag.core.errors import InputError


def sample_dir() -> Path:
    """The folder of the sample (`meta.json`, `observations.jsonl`, `edges.jsonl`, queries), ready for `ingest`.

    Raises InputError where the package does not lie in a folder, for example when it is imported from a zip archive.
    """
    folder = Path(str(resources.files(__name__)))
    if not (folder / "meta.json").is_file():
        raise InputError(
            f"the sample is not in {folder}",
            where=__name__,
            allowed="a package installed as files",
            repair="pip install . in the repository",
        )
    return folder


def sample_queries() -> Path:
    """The 40 labelled queries of the sample, in the `Q.jsonl` contract with label keys besides."""
    return sample_dir() / "queries.jsonl"


def sample_conditions() -> Path:
    """The 48 labelled queries that set conditions in words (near, away from, not); `half` splits them in two."""
    return sample_dir() / "conditions.jsonl"
