"""Scene descriptions: what a world is made of, as readable YAML (docs/sim.md says how to write one)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from erag.core.errors import ConfigError
from erag.sim.materials import Season, materials
from erag.sim.vocabulary import classes, parse, validated

Side = Literal["north", "east", "south", "west"]
Light = Literal["morning", "midday", "overcast", "evening", "night", "indoor"]
Weather = Literal["clear", "cloudy", "misty", "snow"]
Point2 = tuple[float, float]
Box = tuple[float, float, float, float]  # west, south, east, north in metres
COMPASS: Mapping[str, float] = {"east": 0.0, "north": 90.0, "west": 180.0, "south": 270.0}


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Stand(_Strict):
    """Objects of a class (or of one chosen from several), in one of five ways.

    `at`: at points of the area, metres from its south-west corner; `wall`: with the back to a side, at fractions
    `along` it; `row`: `count` of them from one point to another; `scatter`: that many anywhere; `on`: on top of each
    object of that class. `facing` is a compass word or degrees; `chance` is how likely each stands there at all;
    `only` restricts it to the first or second visit.
    """

    what: str | tuple[str, ...]
    at: tuple[Point2, ...] = ()
    wall: Side | None = None
    along: tuple[float, ...] = (0.5,)
    row: tuple[Point2, Point2] | None = None
    count: int = Field(2, ge=1)
    scatter: int = Field(0, ge=0)
    on: str = ""
    facing: str | float | None = None
    chance: float = Field(1.0, gt=0, le=1)
    only: Literal[1, 2] | None = None
    text: str = ""
    colour: str = ""
    shape: int | None = None
    extent: float | None = None
    gap: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """The classes it may be."""
        return (self.what,) if isinstance(self.what, str) else self.what

    @model_validator(mode="after")
    def _sound(self) -> Stand:
        unknown = [n for n in (*self.names, *((self.on,) if self.on else ())) if n not in classes()]
        if unknown:
            raise ValueError(f"there is no class {unknown[0]!r}; words/classes.yaml lists them")
        if sum(map(bool, (self.at, self.wall, self.row, self.scatter, self.on))) != 1:
            raise ValueError(f"{self.names[0]}: exactly one of at, wall, row, scatter, on")
        return self


class Room(_Strict):
    """Walls, floor and ceiling round an area; `open` sides have no wall, `windows` sides have windows."""

    wall: str = "plaster"
    floor: str = "parquet"
    ceiling: str = "ceiling"
    height: float = Field(2.8, gt=2.0)
    open: tuple[Side, ...] = ()
    windows: tuple[Side, ...] = ()


class Area(_Strict):
    """A part of a world with a name and a kind of place: its `ground`, perhaps a room, and what stands there."""

    place: str
    name: str
    box: Box
    ground: str = ""
    room: Room | None = None
    stands: tuple[Stand, ...] = ()


class Ground(_Strict):
    """A rectangle of one material on the ground, such as a road; later ones lie on earlier ones."""

    material: str
    box: Box


class Path(_Strict):
    """The robot's way: corners in metres, how many nodes, and where it looks from each, in turn.

    A number is degrees to the left of its way; `thing` turns to what stands near and was looked at least.
    """

    points: tuple[Point2, ...] = Field(min_length=2)
    nodes: int = Field(50, ge=2)
    look: tuple[float | Literal["thing"], ...] = (0.0, "thing", "thing")


class Visit(_Strict):
    """When a world is seen: a start time, season, light, weather; which share of mobile things went or moved before."""

    start: str
    season: Season
    light: Light
    weather: Weather = "clear"
    gone: float = Field(0.0, ge=0, lt=1)
    moved: float = Field(0.0, ge=0, lt=1)


class Head(BaseModel):
    """What a world is, without what stands in it."""

    model_config = ConfigDict(frozen=True)

    title: str
    kind: str
    setting: Literal["indoor", "outdoor", "mixed"]
    split: Literal["train", "test"]
    number: int = Field(ge=1)
    robot: Literal["quadruped", "wheeled", "drone"]
    ground: str
    visits: tuple[Visit, ...] = Field(min_length=1, max_length=2)


class Scene(Head, _Strict):
    """A world: areas, grounds, doors (points at which walls have a gap), the robot's path and its visits."""

    areas: tuple[Area, ...] = ()
    grounds: tuple[Ground, ...] = ()
    doors: tuple[Point2, ...] = ()
    path: Path
    reach: float = Field(200.0, gt=0)

    @model_validator(mode="after")
    def _sound(self) -> Scene:
        used = {self.ground, *(g.material for g in self.grounds), *(a.ground for a in self.areas if a.ground)}
        used |= {m for a in self.areas if a.room for m in (a.room.wall, a.room.floor, a.room.ceiling)}
        if unknown := sorted(used - set(materials())):
            raise ValueError(f"there is no material {unknown[0]!r}; words/materials.yaml lists them")
        return self


def scene_names() -> tuple[str, ...]:
    """The shipped worlds in their order: 1 to 10 for training, the others held out."""
    return tuple(sorted(_shipped(), key=lambda name: _shipped()[name]))


def scene_heads() -> list[tuple[str, Head]]:
    """Name and head of each shipped world, in order."""
    return [(name, validated(Head, parse(scene_text(name), name), name)) for name in scene_names()]


def scene_text(name: str) -> str:
    """The description of a shipped world. Raises ConfigError if there is none of that name."""
    if name not in _shipped():
        raise ConfigError(f"there is no world {name!r}", where="--worlds", allowed=", ".join(scene_names()))
    return (resources.files("erag.sim") / "scenes" / f"{name}.yaml").read_text("utf-8")


def parse_scene(text: str, where: str) -> Scene:
    """A scene description. Raises ConfigError naming the field that is wrong."""
    return validated(Scene, parse(text, where), where)


@cache
def _shipped() -> dict[str, int]:
    folder = resources.files("erag.sim") / "scenes"
    files = [f for f in folder.iterdir() if f.name.endswith(".yaml")]
    return {f.name.removesuffix(".yaml"): int(parse(f.read_text("utf-8"), f.name)["number"]) for f in files}
