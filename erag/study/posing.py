"""Views that no path gives: a camera set before objects of every class, so that rare ones are learnt too."""

from __future__ import annotations

import importlib
import json
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from erag.core.cores import cores
from erag.core.errors import ConfigError
from erag.core.output import replacing
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm.features import HEIGHT, WIDTH

_TRIES = 12
_NEAREST, _FARTHEST = 1.2, 30.0  # metres from the object's middle
_APART = (2.0, 7.0)  # radii of the object
_TURN = 0.25  # radians by which the camera looks past it, at most
_MARGIN = 0.35  # metres from walls and from other objects
_QUALITY = 88  # of the JPEG images


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a camera stands and looks (metres, radians)."""

    x: float
    y: float
    yaw: float


def render_views(folder: Path, worlds: Sequence[str], seed: int, each: int, progress: Progress = quiet) -> None:
    """Write `each` views of every class of each world, in the layout of a data set; finished worlds are kept.

    The worlds are those of `seed`. Raises ConfigError where the simulator is not installed or knows no such world.
    """
    missing = [name for name in worlds if not (folder / "truth" / f"{name}.jsonl").is_file()]
    crew, done = simulator("crew"), len(worlds) - len(missing)
    for _ in crew.run_apart(_render_world, [(folder, name, seed, each) for name in missing], cores()):
        done += 1
        progress(f"views of seed {seed}", done, len(worlds))


def render_studios(folder: Path, count: int, seed: int, painted: bool, progress: Progress = quiet) -> None:
    """Write the views of `count` studios, `painted` or not, in the layout of a data set; finished ones are kept."""
    missing = [number for number in range(count) if not (folder / "truth" / f"studio{number}.jsonl").is_file()]
    crew, done = simulator("crew"), count - len(missing)
    for _ in crew.run_apart(_render_studio, [(folder, number, seed, painted) for number in missing], cores()):
        done += 1
        progress(f"{'painted ' if painted else ''}studios of seed {seed}", done, count)


def _render_studio(folder: Path, number: int, seed: int, painted: bool) -> None:
    name, scene = f"studio{number}", simulator("studio").studio_scene(number, seed, painted=painted)
    (world,) = simulator("layout").worlds(name, scene, seed)
    _write(folder, name, _shots(world, folder, [stop.camera for stop in world.stops]))


def _render_world(folder: Path, name: str, seed: int, each: int) -> None:
    visits = simulator("dataset").open_world(name, seed)
    lines: list[str] = []
    for turn, world in enumerate(visits):
        rng = np.random.default_rng(int.from_bytes(content_hash("views", name, str(seed), str(turn))[:8], "little"))
        height, pitch = simulator("camera").BODIES[world.scene.robot]
        chosen = poses(world, rng, -(-each // len(visits)))
        eyes = [simulator("camera").Camera(pose.x, pose.y, height, pose.yaw, pitch) for pose in chosen]
        lines += _shots(world, folder, eyes)
    _write(folder, name, lines)


def _write(folder: Path, name: str, lines: Iterable[str]) -> None:
    kept = list(lines)
    (folder / "truth").mkdir(exist_ok=True)
    with replacing(folder / "truth" / f"{name}.jsonl") as file:
        file.writelines(f"{line}\n" for line in kept)


def _shots(world: Any, folder: Path, eyes: Sequence[Any]) -> Iterator[str]:
    """Render what cameras see of a visit; a line of truth for each that shows something."""
    truth, light = simulator("truth"), simulator("light")
    size = simulator("camera").Size(WIDTH, HEIGHT)
    images = folder / "worlds" / world.name / "images"
    images.mkdir(parents=True, exist_ok=True)
    with simulator("renderer").Renderer() as renderer:
        renderer.load(world.solids, range(len(world.solids)))
        for number, eye in enumerate(eyes):
            frame = renderer.draw(eye, size, light.MOODS[world.when.light].lamp)
            node = f"{world.name}-{'ab'[world.visit - 1]}-view-{number:04d}"
            seen = truth.view(world, simulator("route").Stop(number, 0.0, eye), frame, node)
            if seen.visible:
                shown = light.finished(frame, eye, size, world.when)
                Image.fromarray(shown).save(images / f"{node}.jpg", quality=_QUALITY)
                yield _line(seen, world.scene.title)


def _line(seen: Any, title: str) -> str:
    raw = json.loads(simulator("truth").to_json(seen))
    return json.dumps({**raw, "caption": simulator("captions").caption(seen, title)}, ensure_ascii=False)


def poses(world: Any, rng: np.random.Generator, each: int) -> Iterator[Pose]:
    """`each` cameras before objects of every class of a world, fewer where none finds room."""
    by_class: dict[str, list[Any]] = defaultdict(list)
    for thing in world.things:
        if thing is not None:
            by_class[thing.name].append(thing)
    for name in sorted(by_class):
        for _ in range(each):
            thing = by_class[name][int(rng.integers(len(by_class[name])))]
            found = next(filter(None, (_pose(world, thing, rng) for _ in range(_TRIES))), None)
            if found is not None:
                yield found


def _pose(world: Any, thing: Any, rng: np.random.Generator) -> Pose | None:
    """A camera that looks at a thing from somewhere near it; None where something or a wall is in the way."""
    away = min(max(thing.radius * rng.uniform(*_APART), _NEAREST), _FARTHEST)
    bearing = rng.uniform(-math.pi, math.pi)
    x, y = thing.x + away * math.cos(bearing), thing.y + away * math.sin(bearing)
    area = world.scene.areas[thing.area] if thing.area >= 0 else None
    if area is not None and area.room is not None:
        west, south, east, north = area.box
        if not (west + _MARGIN < x < east - _MARGIN and south + _MARGIN < y < north - _MARGIN):
            return None
    others = (t for t in world.things if t is not None and t is not thing)
    if any(math.dist((x, y), (t.x, t.y)) < min(t.radius, 3.0) + _MARGIN for t in others):
        return None
    return Pose(round(x, 4), round(y, 4), round(bearing + math.pi + rng.uniform(-_TURN, _TURN), 6))


def simulator(part: str) -> Any:
    """A module of the simulator. Raises ConfigError where it is not installed."""
    try:
        return importlib.import_module(f"erag.sim.{part}")
    except ImportError as error:
        what = f"{error.name} is not installed"
        raise ConfigError(what, where="erag.sim", repair="pip install 'erag[sim]'") from error
