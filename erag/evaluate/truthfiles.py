"""Ground truth read from files: `truth.jsonl` beside a map, or what a map's own captions and names say."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import InputError
from erag.core.text import clean, name_words
from erag.data.registry import read
from erag.evaluate.truth import NodeTruth, SeenObject, Truths

TRUTH, SPLITS = "truth.jsonl", "splits.json"
MAX_FILE = 512 * 1024 * 1024  # bytes
Name = Annotated[str, Field(min_length=1, max_length=200)]
Text = Annotated[str, Field(max_length=4000)]


class _Object(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    name: Name
    area: float = Field(1.0, ge=0, le=1)


class _Line(BaseModel):
    """A line of `truth.jsonl`; unknown keys are ignored, so that a simulator may say more."""

    model_config = ConfigDict(frozen=True, extra="ignore", coerce_numbers_to_str=True)

    node: Name
    objects: tuple[_Object, ...] | None = None
    captions: tuple[Text, ...] = ()
    place: Text = ""
    attributes: tuple[Text, ...] = ()
    image: Text | None = None


def read_truth(folder: Path) -> Truths:
    """The truth of a folder's `truth.jsonl`, independent of what a memory is given.

    A line a node: `{"node", "objects": [{"name", "area"}], "captions": [text], "place", "attributes": [text],
    "image"}`, all but `node` optional, areas as shares of the image, the image relative to the folder. Raises
    InputError with the line for what is no such line, a node that comes twice, and an image outside the folder.
    """
    found: dict[str, NodeTruth] = {}
    path = folder / TRUTH
    for number, text in enumerate(_text(path).split("\n"), 1):
        if not text.strip():
            continue
        where = f"{path}: line {number}"
        truth = _truth(folder, text, where)
        if truth.node in found:
            raise InputError(f"the node {truth.node!r} is there twice", where=where, allowed="a line a node")
        found[truth.node] = truth
    return Truths(found)


def captions_as_truth(source: Path) -> Truths:
    """The captions of a map as reference captions. They are what the memory holds: not independent of it."""
    nodes = read(source).observations
    found = {o.id: NodeTruth(o.id, captions=(o.caption,)) for o in nodes if o.caption}
    return Truths(found, independent=False)


def names_as_truth(source: Path) -> Truths:
    """The names of a map's object nodes as lists of one object each. They are what the memory holds."""
    nodes = [o for o in read(source).observations if o.kind == "object" and o.name]
    found = {o.id: NodeTruth(o.id, (SeenObject(name_words(clean(o.name or ""))),)) for o in nodes}
    return Truths(found, independent=False)


def read_splits(path: Path) -> Mapping[str, str]:
    """`{environment: split}`; empty where there is no such file. Raises InputError for anything else in it."""
    if not path.exists():
        return {}
    try:
        raw = json.loads(_text(path))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", where=str(path)) from error
    if not isinstance(raw, dict) or not all(isinstance(v, str) for v in raw.values()):
        raise InputError("not a table of texts", where=str(path), allowed='{"world": "train" | "test"}')
    return raw


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_FILE:
            raise InputError(f"{path.stat().st_size:,} bytes", where=str(path), allowed=f"at most {MAX_FILE:,}")
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path), allowed="UTF-8 text") from error


def _truth(folder: Path, text: str, where: str) -> NodeTruth:
    try:
        line = _Line.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        at = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{at or 'line'}: {first['msg']}", where=where, allowed='{"node": …, "objects": …}') from error
    objects = None if line.objects is None else tuple(SeenObject(clean(o.name), o.area) for o in line.objects)
    image = None if line.image is None else _inside(folder, line.image, where)
    captions = tuple(clean(c) for c in line.captions if clean(c))
    attributes = tuple(clean(a) for a in line.attributes)
    return NodeTruth(line.node, objects, captions, clean(line.place), attributes, image)


def _inside(folder: Path, image: str, where: str) -> Path:
    path = folder / image
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"the image {image!r} lies outside the folder", where=where, allowed="a relative path")
    return path
