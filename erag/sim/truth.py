"""Ground truth: what each frame shows, from the mask of its pixels; kept as JSON lines beside the observations."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.sim.camera import Frame, Size
from erag.sim.layout import Thing, World, contains
from erag.sim.materials import materials
from erag.sim.route import Stop
from erag.sim.vocabulary import classes

VISIBLE = 0.01  # share of the image from which on an object counts as visible
_MIN_PIXELS = 12  # fewer pixels of an object are not recorded
_NEXT_TO = 1.6  # footprints nearer than this many metres stand next to each other


@dataclass(frozen=True, slots=True)
class Seen:
    """An object in a frame: instance, class, look, `share` of the image's pixels, and where it is.

    `box` is x0, y0, x1, y1 in 0..1, y down; `side` is left, centre or right; `metres` the distance from the camera;
    `text` what is written on it; `beside` are the visible instances next to it.
    """

    instance: str
    name: str
    shape: str
    colour: str
    share: float
    box: tuple[float, float, float, float]
    side: str
    metres: float
    text: str = ""
    beside: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class View:
    """What one frame shows.

    `place` is the kind and `place_name` the name of the place that fills most of it; `surfaces` are shares of the image
    by kind of ground, `ndvi` is the mean over all pixels but the sky's.
    """

    node: str
    world: str
    split: str
    visit: int
    place: str
    place_name: str
    standing_in: str
    indoor: bool
    season: str
    light: str
    weather: str
    sky: float
    ndvi: float
    surfaces: Mapping[str, float]
    objects: tuple[Seen, ...]
    caption: str = ""

    @property
    def visible(self) -> tuple[Seen, ...]:
        """The objects that cover at least `VISIBLE` of the image, largest first."""
        return tuple(o for o in self.objects if o.share >= VISIBLE)


def ndvi_image(frame: Frame) -> npt.NDArray[np.float64]:
    """(h, w) NDVI = (NIR − R) / (NIR + R) of what each pixel shows, NaN for the sky (paper, section on data)."""
    table = np.array([materials()[name].ndvi for name in frame.materials])
    return np.where(frame.sky, np.nan, table[np.where(frame.sky, 0, frame.material)])


def view(world: World, stop: Stop, frame: Frame, node: str) -> View:
    """The truth of a frame seen at a stop of a world."""
    index = ndvi_image(frame)
    standing = _standing(world, stop)
    inside = world.scene.setting == "indoor" or (standing >= 0 and world.scene.areas[standing].room is not None)
    place, name = _place(world, stop, frame)
    when = world.when
    return View(
        node=node, world=world.name, split=world.scene.split, visit=world.visit, place=place, place_name=name,
        standing_in=_name(world, standing), indoor=inside, season=when.season, light=when.light,
        weather=when.weather, sky=round(float(frame.sky.mean()), 4),
        ndvi=0.0 if frame.sky.all() else round(float(np.nanmean(index)), 4), surfaces=_surfaces(world, frame),
        objects=tuple(_objects(world, stop, frame)),
    )  # fmt: skip


def to_json(seen: View) -> str:
    """A view as one line of JSON."""
    return json.dumps(asdict(seen), ensure_ascii=False)


def from_json(line: str) -> View:
    """The view that `to_json` wrote. Raises ValueError for anything else."""
    raw: dict[str, Any] = json.loads(line)
    try:
        objects = tuple(Seen(**{**o, "box": tuple(o["box"]), "beside": tuple(o["beside"])}) for o in raw["objects"])
        return View(**{**raw, "objects": objects})
    except (TypeError, KeyError) as error:
        raise ValueError(f"no line of ground truth: {error}") from error


def read_truth(path: Path) -> list[View]:
    """All views of a truth file. Raises InputError naming the line that is none."""
    views = []
    try:
        lines = path.read_text("utf-8").splitlines()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), repair="erag sim build") from None
    for number, line in enumerate(lines, start=1):
        try:
            views.append(from_json(line))
        except ValueError as error:
            raise InputError(str(error), where=f"{path}:{number}", repair="erag sim build") from None
    return views


def colour_of(thing: Thing) -> str:
    """The colour a caption may name: that of the style, where the class is painted at all."""
    looks = (classes()[thing.name].train, classes()[thing.name].held_out)
    painted = any(thing.style.colour in look.colours for look in looks if look)
    return thing.style.colour if painted else ""


def shape_of(thing: Thing) -> str:
    """The word for the shape of an object, empty where its class has none."""
    kind = classes()[thing.name]
    shapes = {**(kind.held_out.shapes if kind.held_out else {}), **kind.train.shapes}
    return shapes.get(thing.style.shape, "")


def _objects(world: World, stop: Stop, frame: Frame) -> Iterator[Seen]:
    pixels = frame.solid.size
    h, w = frame.solid.shape
    rows, counts = np.unique(frame.solid, return_counts=True)
    order = sorted(zip(counts.tolist(), rows.tolist(), strict=True), key=lambda p: (-p[0], p[1]))
    shown = [(n, world.things[r], r) for n, r in order if r >= 0 and n >= _MIN_PIXELS]
    things = [(n, t, r) for n, t, r in shown if t is not None]
    near = [t for n, t, _ in things if n >= VISIBLE * pixels]
    for count, thing, row in things:
        ys, xs = np.nonzero(frame.solid == row)
        box = (xs.min() / w, ys.min() / h, (xs.max() + 1) / w, (ys.max() + 1) / h)
        beside = tuple(o.id for o in near if o is not thing and _adjacent(o, thing)) if thing in near else ()
        yield Seen(
            thing.id, thing.name, shape_of(thing), colour_of(thing), round(count / pixels, 5),
            (round(float(box[0]), 3), round(float(box[1]), 3), round(float(box[2]), 3), round(float(box[3]), 3)),
            _side(float(xs.mean()) / w), round(math.hypot(thing.x - stop.camera.x, thing.y - stop.camera.y), 2),
            thing.style.text.replace("\n", " ").replace("|", ", "), beside,
        )  # fmt: skip


def _adjacent(a: Thing, b: Thing) -> bool:
    return math.dist((a.x, a.y), (b.x, b.y)) < a.radius + b.radius + _NEXT_TO


def _side(middle: float) -> str:
    return "left" if middle < 0.36 else "right" if middle > 0.64 else "centre"


def _surfaces(world: World, frame: Frame) -> dict[str, float]:
    """Shares of the image by kind of ground, largest first."""
    ground = np.array([t is None for t in world.things])
    mask = ~frame.sky & ground[np.where(frame.sky, 0, frame.solid)]
    found: dict[str, float] = {}
    for material, count in zip(*np.unique(frame.material[mask], return_counts=True), strict=True):
        noun = materials()[frame.materials[int(material)]].noun
        if noun:
            found[noun] = round(found.get(noun, 0.0) + float(count) / frame.solid.size, 4)
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))


def _place(world: World, stop: Stop, frame: Frame) -> tuple[str, str]:
    """Kind and name of the area that most pixels belong to; where none does, of the area the robot stands in."""
    areas = np.array(world.areas)[np.where(frame.sky, 0, frame.solid)]
    close = ~frame.sky & (areas >= 0) & (frame.depth < 25)
    counts = np.bincount(areas[close], minlength=len(world.scene.areas)) if close.any() else np.zeros(1)
    row = int(np.argmax(counts)) if counts.max() >= 0.04 * frame.solid.size else _standing(world, stop)
    return (
        (world.scene.areas[row].place, world.scene.areas[row].name)
        if row >= 0
        else (world.scene.kind, world.scene.title)
    )


def _standing(world: World, stop: Stop) -> int:
    at = (stop.camera.x, stop.camera.y)
    rows = [i for i, a in enumerate(world.scene.areas) if contains(a, at)]
    return min(rows, key=lambda i: _extent(world, i), default=-1)


def _extent(world: World, row: int) -> float:
    x0, y0, x1, y1 = world.scene.areas[row].box
    return (x1 - x0) * (y1 - y0)


def _name(world: World, row: int) -> str:
    return world.scene.areas[row].name if row >= 0 else world.scene.title


def pixels(size: Size) -> int:
    """Pixels from which on an object counts as visible in a picture of this size."""
    return math.ceil(VISIBLE * size.width * size.height)
