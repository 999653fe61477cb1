"""Simulated worlds as examples: a folder a world, with images and `truth.jsonl`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import InputError
from erag.study.examples import Example, Thing

TRUTH = "truth.jsonl"
_MAX_LINE = 1 << 20


class _Object(BaseModel):
    """A visible object of a row."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str = Field(alias="class", min_length=1, max_length=80)
    share: float = Field(ge=0, le=1)
    centre: tuple[float, float]
    attributes: tuple[str, ...] = ()


class _Row(BaseModel):
    """An image and what is known to be in it."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    image: str = Field(min_length=1, max_length=400)
    place: str
    light: str = ""
    caption: str
    objects: tuple[_Object, ...] = ()


def read_worlds(folder: Path) -> Mapping[str, list[Example]]:
    """The examples of each world in `folder`, by the name of its folder. Raises InputError for what cannot be read."""
    found = sorted(path.parent for path in folder.glob(f"*/{TRUTH}"))
    if not found:
        raise InputError(f"holds no folder with {TRUTH}", where=str(folder), repair=f"erag sim build --out {folder}")
    return {world.name: _world(world) for world in found}


def _world(folder: Path) -> list[Example]:
    examples = []
    with (folder / TRUTH).open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            where = f"{folder / TRUTH}:{number}"
            if len(line) > _MAX_LINE:
                raise InputError(f"a line of {len(line)} characters", where=where, allowed=f"up to {_MAX_LINE}")
            examples.append(_example(folder, line, where))
    return examples


def _example(folder: Path, line: str, where: str) -> Example:
    try:
        row = _Row.model_validate_json(line)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InputError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}", where=where) from error
    image = folder / row.image
    if not image.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"the image {row.image!r} lies outside the world", where=where)
    return Example(image, folder.name, row.place, row.light, row.caption, _things(row.objects))


def _things(objects: tuple[_Object, ...]) -> tuple[Thing, ...]:
    """The objects by class: shares added up, place and attributes of the largest."""
    by_name: dict[str, list[_Object]] = defaultdict(list)
    for item in objects:
        by_name[item.name].append(item)
    things = []
    for name, items in by_name.items():
        largest = max(items, key=lambda o: o.share)
        share = min(1.0, float(np.sum([o.share for o in items])))
        things.append(Thing(name, share, *largest.centre, len(items), largest.attributes))
    return tuple(things)
