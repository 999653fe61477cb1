"""Ground truth read from files: the simulator's, or what a map's own captions and names say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import InputError
from erag.core.text import clean, name_words
from erag.core.types import Observation
from erag.data.registry import read
from erag.evaluate.truth import NodeTruth, SeenObject, Truths

MAX_FILE = 512 * 1024 * 1024  # bytes
Name = Annotated[str, Field(min_length=1, max_length=200)]
Text = Annotated[str, Field(max_length=4000)]


class _Object(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    name: Name
    area: float = Field(1.0, ge=0, le=1, validation_alias=AliasChoices("area", "share"))
    colour: Text = ""
    shape: Text = ""
    text: Text = ""

    def seen(self) -> SeenObject:
        look = " ".join(part for part in (clean(self.colour), clean(self.shape)) if part)
        return SeenObject(clean(self.name), self.area, look, clean(self.text))


class _Line(BaseModel):
    """A line of a truth file; unknown keys are ignored, so that a simulator may say more."""

    model_config = ConfigDict(frozen=True, extra="ignore", coerce_numbers_to_str=True)

    node: Name
    objects: tuple[_Object, ...] | None = None
    captions: tuple[Text, ...] = ()
    caption: Text = ""
    place: Text = ""
    attributes: tuple[Text, ...] = ()
    season: Text = ""
    light: Text = ""
    weather: Text = ""
    image: Text | None = None
    split: Text = ""


@dataclass(frozen=True)
class WorldTruth:
    """A truth file: what is known of each node, and the split it states (empty where it states none)."""

    nodes: Mapping[str, NodeTruth]
    split: str


def read_truth(path: Path, folder: Path) -> WorldTruth:
    """The truth file `path` of the world in `folder`.

    A line a node: `{"node", "objects": [{"name", "area" (or "share"), "colour", "shape", "text"}], "captions": [text]
    (or "caption"), "place", "attributes": [text], "season", "light", "weather", "image", "split"}`, all but `node`
    optional, areas as shares of the image, the image relative to `folder`. Raises InputError with the line for what is
    no such line, a node that comes twice, an image outside the folder, and a second split.
    """
    found, splits = dict[str, NodeTruth](), set[str]()
    for number, text in enumerate(_text(path).split("\n"), 1):
        if not text.strip():
            continue
        where = f"{path}: line {number}"
        line = _line(text, where)
        if line.node in found:
            raise InputError(f"the node {line.node!r} is there twice", where=where, allowed="a line a node")
        found[line.node] = _truth(line, folder, where)
        splits |= {line.split} - {""}
        if len(splits) > 1:
            raise InputError(f"the splits {sorted(splits)}", where=where, allowed="one split a world")
    return WorldTruth(found, next(iter(splits), ""))


def captions_as_truth(source: Path) -> Truths:
    """The captions of a map as reference captions. They are what the memory holds: not independent of it."""
    nodes = read(source).observations
    found = {o.id: NodeTruth(o.id, captions=(o.caption,)) for o in nodes if o.caption}
    return Truths(found, independent=False)


def names_as_truth(source: Path) -> Truths:
    """The names of a map's object nodes as lists of one object each. They are what the memory holds."""
    return Truths(object_nodes(read(source).observations), independent=False)


def object_nodes(nodes: Iterable[Observation]) -> dict[str, NodeTruth]:
    """Of each object node with a name the truth that this object is there."""
    named = [o for o in nodes if o.kind == "object" and o.name]
    return {o.id: NodeTruth(o.id, (SeenObject(name_words(clean(o.name or ""))),)) for o in named}


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_FILE:
            raise InputError(f"{path.stat().st_size:,} bytes", where=str(path), allowed=f"at most {MAX_FILE:,}")
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path), allowed="UTF-8 text") from error


def _line(text: str, where: str) -> _Line:
    try:
        return _Line.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        at = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{at or 'line'}: {first['msg']}", where=where, allowed='{"node": …, "objects": …}') from error


def _truth(line: _Line, folder: Path, where: str) -> NodeTruth:
    objects = None if line.objects is None else tuple(o.seen() for o in line.objects)
    image = None if line.image is None else _inside(folder, line.image, where)
    captions = tuple(clean(c) for c in (*line.captions, line.caption) if clean(c))
    stated = (*line.attributes, line.season, line.light, line.weather)
    return NodeTruth(
        line.node, objects, captions, clean(line.place), tuple(clean(a) for a in stated if clean(a)), image
    )


def _inside(folder: Path, image: str, where: str) -> Path:
    path = folder / image
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"the image {image!r} lies outside the folder", where=where, allowed="a relative path")
    return path
