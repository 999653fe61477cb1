"""Simulated worlds as examples: the data set that `erag sim build` writes, made first where it is not there yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.cores import cores
from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.study.examples import Example, Instance
from erag.study.posing import simulator

_MAX_LINE = 1 << 20
_WORK = ".work"  # of a data set that is not finished
_LIGHTS = {
    "morning": "in the morning", "midday": "at midday", "overcast": "under an overcast sky",
    "evening": "in the evening", "night": "at night", "indoor": "",
}  # fmt: skip
_WEATHERS = {"misty": "in mist", "snow": "in snow"}


class _Object(BaseModel):
    """A visible instance: its class, its share of the image, its box (x0, y0, x1, y1; y down, 0 to 1)."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str = Field(min_length=1, max_length=80)
    share: float = Field(ge=0, le=1)
    box: tuple[float, float, float, float]
    colour: str = ""
    shape: str = ""
    metres: float = Field(0.0, ge=0)


class _Row(BaseModel):
    """A frame and what is known to be in it."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    node: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,199}$")
    place: str
    light: str = ""
    weather: str = ""
    caption: str
    objects: tuple[_Object, ...] = ()


def read_worlds(folder: Path) -> Mapping[str, list[Example]]:
    """The examples of each world of a data set, by name. Raises InputError for what cannot be read."""
    found = sorted((folder / "truth").glob("*.jsonl"))
    if not found:
        raise InputError("holds no data set of worlds", where=str(folder), repair=f"erag sim build --out {folder}")
    return {path.stem: _world(folder, path) for path in found}


def render(
    folder: Path, worlds: Sequence[str], seed: int, progress: Progress = quiet, *, objects: bool = True,
    captions: Literal["none", "truth"] = "none", size: tuple[int, int] | None = None,
) -> None:  # fmt: skip
    """Make the data set of some worlds (none: all) from a seed; what is there already stays as it is.

    `objects` become nodes of their own; frames have no captions, or true ones; `size` are their width and height in
    pixels, else the data set's own. Raises ConfigError where the simulator, which worlds that are all there do not
    need, is not installed or knows no such world.
    """
    there = [(folder / "worlds" / name / "meta.json").is_file() for name in worlds]  # what is written last of a world
    if worlds and all(there) and not (folder / _WORK).exists():
        return
    dataset = simulator("dataset")
    sized = {} if size is None else {"size": simulator("camera").Size(*size)}
    plan = dataset.Plan(worlds=tuple(worlds), seed=seed, objects=objects, captions=captions, **sized)
    dataset.build(folder, plan, progress, jobs=cores())


def _world(folder: Path, path: Path) -> list[Example]:
    examples = []
    with path.open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            where = f"{path}:{number}"
            if len(line) > _MAX_LINE:
                raise InputError(f"a line of {len(line)} characters", where=where, allowed=f"up to {_MAX_LINE}")
            examples.append(_example(folder / "worlds" / path.stem / "images", path.stem, line, where))
    return examples


def _example(images: Path, world: str, line: str, where: str) -> Example:
    try:
        row = _Row.model_validate_json(line)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InputError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}", where=where) from error
    light = " ".join(filter(None, (_LIGHTS.get(row.light, row.light), _WEATHERS.get(row.weather, ""))))
    return Example(images / f"{row.node}.jpg", world, row.place, light, row.caption, tuple(map(_instance, row.objects)))


def _instance(item: _Object) -> Instance:
    return Instance(item.name, item.share, item.box, item.colour, item.shape, item.metres)
