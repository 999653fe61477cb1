"""coex_1f: 50 frames of a real walk through a lobby, each with a caption and a list of objects by a cloud model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from erag.core.text import clean, content_hash
from erag.core.types import Observation
from erag.data.coex import NODES, said_and_listed
from erag.data.contract import QueryLine
from erag.data.registry import read
from erag.evaluate.dataset import Dataset, Environment, Question, questions, required
from erag.evaluate.truthfiles import captions_as_truth
from erag.lm.wording import article
from erag.retrieve.lexical import LexicalIndex, tokens

NAME = "coex_1f"
_MOST = 0.25  # of the frames; what is in more of them is no place to go to


def load(root: Path, queries: Path | None) -> Dataset:
    """The walk in the folder `root`. Without `queries` it is asked for each thing that the cloud model lists."""
    required(root / NODES, "the walk's captions")
    asked = tuple(listed(read(root).observations)) if queries is None else questions(queries, {"environment": NAME})
    environment = Environment(NAME, root, asked, captions_as_truth(root), split="dev")
    return Dataset(NAME, (environment,), ("questions and labels are what the cloud model's captions list and say",))


def listed(frames: Sequence[Observation]) -> Iterator[Question]:
    """A question for each thing that is listed and that the captions of at most a quarter of the frames name."""
    said = [said_and_listed(clean(frame.caption or "")) for frame in frames]
    index = LexicalIndex([" ".join((text, *things)) for text, things in said])
    names = dict.fromkeys(tuple(tokens(thing)) for _, things in said for thing in things)
    for name in filter(None, names):
        rows = index.phrase_rows(name)
        if len(rows) <= _MOST * len(frames):
            text = f"Show me {article(' '.join(name))}."
            key = content_hash(text).hex()[:8]
            line = QueryLine(0, f"{NAME}-{key}", {"id": f"{NAME}-{key}", "query": text, "kind": "explicit"})
            yield Question(line, "explicit", frozenset(frames[row].id for row in rows))
