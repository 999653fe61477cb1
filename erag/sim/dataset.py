"""Writes worlds as a data set: observation folders through data's writer, GML, ground truth, queries; resumable."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from PIL import Image

from erag.core.errors import InputError
from erag.core.output import replacing
from erag.core.progress import Progress, quiet
from erag.core.times import parse_time
from erag.core.types import EdgeKind, Frame, Interval, Observation, Pose
from erag.data.reading import GivenEdge, Reading
from erag.data.writer import write_folder, write_gml
from erag.sim.asking import moment
from erag.sim.camera import Size
from erag.sim.captions import caption, object_caption
from erag.sim.crew import run_apart
from erag.sim.layout import Thing, World, worlds
from erag.sim.light import MOODS, finished
from erag.sim.queries import queries
from erag.sim.renderer import Renderer
from erag.sim.scene import parse_scene, scene_names, scene_text
from erag.sim.town import town_scene
from erag.sim.truth import VISIBLE, View, from_json, read_truth, to_json, view

Setting = Literal["e-image", "e-multimodal"]
Captions = Literal["none", "truth"]
CHUNK = 24  # frames that are rendered with the same solids loaded, and committed together
CHUNKS_APART = 4  # chunks drawn by one process; pybullet keeps some 100 MB of every scene it has shown
MANY_STOPS = 1000  # a world with more of them is drawn in the size of a town
QUALITY = 88  # of the JPEG images
WORK = ".work"
SENSORS = {"ndvi": (-1.0, 1.0)}


@dataclass(frozen=True, slots=True)
class Plan:
    """What to build: worlds (empty: all), setting, seed, size of the images, object nodes and captions or not."""

    worlds: tuple[str, ...] = ()
    setting: Setting = "e-multimodal"
    seed: int = 0
    size: Size = field(default_factory=Size)
    town_size: Size = field(default_factory=lambda: Size(256, 192))
    objects: bool = True
    captions: Captions = "none"

    @property
    def names(self) -> tuple[str, ...]:
        """The worlds in their order."""
        return tuple(n for n in scene_names() if not self.worlds or n in self.worlds)


def build(out: Path, plan: Plan, progress: Progress = quiet, jobs: int = 0) -> None:
    """Write the data set of `plan` into `out`; killed at any moment, the same call continues to the same bytes.

    Frames are drawn by `jobs` processes at once, with 0 in this one. Raises InputError if `out` holds a data set of
    another plan, ConfigError for an unknown world.
    """
    for name in plan.worlds:
        scene_text(name)
    _claim(out, plan)
    if jobs:
        _draw_apart(out, plan, progress, jobs)
    for name in plan.names:
        build_world(out, name, plan, progress)
    write_queries(out, plan)
    shutil.rmtree(out / WORK, ignore_errors=True)


def build_world(out: Path, name: str, plan: Plan, progress: Progress = quiet) -> None:
    """Render one world, write its folder, GML and truth; nothing is done twice."""
    work = out / WORK / name
    if _is_built(out, name):
        shutil.rmtree(work, ignore_errors=True)
        return
    visits = open_world(name, plan.seed)
    views = [v for world in visits for v in _rendered(world, _size(world, plan), work, progress)]
    with replacing(_truth(out, name)) as file:
        file.writelines(f"{to_json(v)}\n" for v in views)
    made = reading(visits, views, work, plan)
    write_gml(out / "gml" / f"{name}.gml", made)
    write_folder(out / "worlds" / name, made)  # last: a world that has its folder is done
    shutil.rmtree(work)


def open_world(name: str, seed: int) -> tuple[World, ...]:
    """A shipped world on each of its visits. Raises ConfigError if there is none of that name."""
    text = scene_text(name)
    scene = town_scene(text, name, seed) if name == "town" else parse_scene(text, f"{name}.yaml")
    return worlds(name, scene, seed)


def reading(visits: Sequence[World], views: Sequence[View], root: Path, plan: Plan) -> Reading:
    """What the robot recorded: place nodes with images, path edges, and nodes of the objects it saw."""
    by_node = {v.node: v for v in views}
    places, objects, edges = [], [], []
    for world in visits:
        nodes = [node_id(world, s.index) for s in world.stops]
        places += [_place(world, i, by_node[n], plan) for i, n in enumerate(nodes)]
        steps = [b.metres - a.metres for a, b in zip(world.stops, world.stops[1:], strict=False)]
        edges += [GivenEdge(a, b, EdgeKind.PATH, round(m, 3)) for a, b, m in zip(nodes, nodes[1:], steps, strict=False)]
        if plan.objects:
            seen = list(_seen_from([by_node[n] for n in nodes]))
            things = {t.id: t for t in world.things if t is not None}
            objects += [_object(things[i], world, plan) for i, _ in seen]
            edges += [GivenEdge(object_id(i, world), node, EdgeKind.OBSERVED_FROM) for i, node in seen]
    sensors = SENSORS if plan.setting == "e-multimodal" else {}
    about = f"simulated: {visits[0].scene.title}, seed {plan.seed}"
    notes = (f"{about}; an object node stands for what covered at least {VISIBLE:.0%} of an image",)
    return Reading(visits[0].name, root, Frame.METRIC, (*places, *objects), tuple(edges), sensors=sensors, notes=notes)


def node_id(world: World, index: int) -> str:
    """The id of a place node: world, visit (a or b), number."""
    return f"{world.name}-{'ab'[world.visit - 1]}-{index:04d}"


def object_id(instance: str, world: World) -> str:
    """The id of the node of an object on a visit."""
    return f"{instance}@{'ab'[world.visit - 1]}"


def write_queries(out: Path, plan: Plan) -> None:
    """Write `queries.jsonl` for all worlds that are there, from their truth alone."""
    there = [name for name in scene_names() if _truth(out, name).is_file()]
    with replacing(out / "queries.jsonl") as file:
        for name in there:
            visits = open_world(name, plan.seed)
            lines = queries(visits, read_truth(_truth(out, name)), plan.setting, plan.seed, objects=plan.objects)
            file.writelines(f"{json.dumps(line, ensure_ascii=False)}\n" for line in lines)


def _truth(out: Path, name: str) -> Path:
    return out / "truth" / f"{name}.jsonl"


def _claim(out: Path, plan: Plan) -> None:
    """Note the plan in `dataset.json`, or check that it is the one noted there; worlds may be added."""
    stated = {
        "format": "erag-sim", "version": 1, "setting": plan.setting, "seed": plan.seed,
        "size": [plan.size.width, plan.size.height], "town_size": [plan.town_size.width, plan.town_size.height],
        "objects": plan.objects, "captions": plan.captions, "visible": VISIBLE,
    }  # fmt: skip
    path = out / "dataset.json"
    if path.is_file():
        if json.loads(path.read_text("utf-8")) != stated:
            raise InputError("it holds a data set with other settings", where=str(path), repair="another --out")
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("the folder holds other files", where=str(out), allowed="a new or empty folder")
    out.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        file.write(json.dumps(stated, indent=1) + "\n")


def _is_built(out: Path, name: str) -> bool:
    return (out / "worlds" / name / "meta.json").is_file() and _truth(out, name).is_file()


def _size(world: World, plan: Plan) -> Size:
    return plan.town_size if len(world.stops) > MANY_STOPS else plan.size


def _draw_apart(out: Path, plan: Plan, progress: Progress, jobs: int) -> None:
    """Draw what is missing of all worlds, a few chunks a process."""
    tasks: list[tuple[str, int, int, Size, Path, list[int]]] = []
    for name in plan.names:
        if not _is_built(out, name):
            work = out / WORK / name
            (work / "images").mkdir(parents=True, exist_ok=True)
            for visit, world in enumerate(open_world(name, plan.seed)):
                missing = _missing(work, world)
                parts = [missing[i : i + CHUNKS_APART] for i in range(0, len(missing), CHUNKS_APART)]
                tasks += [(name, plan.seed, visit, _size(world, plan), work, part) for part in parts]
    total, done = sum(len(task[-1]) for task in tasks), 0
    for number in run_apart(draw, tasks, jobs):
        done += len(tasks[number][-1])
        progress(f"render {CHUNK} frames each", done, total)


def draw(name: str, seed: int, visit: int, size: Size, work: Path, chunks: Sequence[int]) -> None:
    """Draw some chunks of a visit of a shipped world into `work`."""
    world = open_world(name, seed)[visit]
    with Renderer() as renderer:
        for number in chunks:
            _render_chunk(renderer, world, size, work, number)


def _missing(work: Path, world: World) -> list[int]:
    return [c for c in range(math.ceil(len(world.stops) / CHUNK)) if not _chunk(work, world, c).is_file()]


def _rendered(world: World, size: Size, work: Path, progress: Progress) -> Iterator[View]:
    """The views of all stops, rendering the chunks that are not in `work` yet."""
    total = len(world.stops)
    (work / "images").mkdir(parents=True, exist_ok=True)
    missing = _missing(work, world)
    if missing:
        with Renderer() as renderer:
            for c in missing:
                _render_chunk(renderer, world, size, work, c)
                progress(f"render {world.name}", min((c + 1) * CHUNK, total), total)
    for c in range(math.ceil(total / CHUNK)):
        yield from (from_json(line) for line in _chunk(work, world, c).read_text("utf-8").splitlines())


def _chunk(work: Path, world: World, number: int) -> Path:
    return work / f"visit{world.visit}-{number:04d}.jsonl"


def _render_chunk(renderer: Renderer, world: World, size: Size, work: Path, number: int) -> None:
    """Render the frames of a chunk; the list of its views is written last, whole or not at all."""
    part = world.stops[number * CHUNK : (number + 1) * CHUNK]
    renderer.load(world.solids, near_rows(world, [(s.camera.x, s.camera.y) for s in part]))
    views = []
    for stop in part:
        node = node_id(world, stop.index)
        frame = renderer.draw(stop.camera, size, MOODS[world.when.light].lamp)
        Image.fromarray(finished(frame, stop.camera, size, world.when)).save(
            work / "images" / f"{node}.jpg", quality=QUALITY
        )
        seen = view(world, stop, frame, node)
        views.append(replace(seen, caption=caption(seen, world.scene.title)))
    with replacing(_chunk(work, world, number)) as file:
        file.writelines(f"{to_json(v)}\n" for v in views)


def near_rows(world: World, eyes: Sequence[tuple[float, float]]) -> list[int]:
    """Rows of the solids that may be seen: grounds and walls, and things within the scene's reach of an eye."""
    reach = world.scene.reach
    return [
        row for row, thing in enumerate(world.things)
        if thing is None or min(math.dist((thing.x, thing.y), e) for e in eyes) < reach + thing.radius
    ]  # fmt: skip


def _place(world: World, index: int, seen: View, plan: Plan) -> Observation:
    camera = world.stops[index].camera
    node = node_id(world, index)
    at = moment(world, index)
    return Observation(
        id=node, kind="place", pose=Pose(camera.x, camera.y, camera.z, camera.yaw), time=Interval(at, at),
        image=f"images/{node}.jpg", caption=seen.caption if plan.captions == "truth" else None,
        sensors={"ndvi": seen.ndvi} if plan.setting == "e-multimodal" else {}, source=world.name,
    )  # fmt: skip


def _seen_from(views: Iterable[View]) -> Iterator[tuple[str, str]]:
    """Each instance that was visible, with the node from which it was seen largest."""
    best: dict[str, tuple[float, str]] = {}
    for v in views:
        for o in v.visible:
            if o.share > best.get(o.instance, (0.0, ""))[0]:
                best[o.instance] = (o.share, v.node)
    yield from ((instance, node) for instance, (_, node) in sorted(best.items()))


def _object(thing: Thing, world: World, plan: Plan) -> Observation:
    when = parse_time(world.when.start).start
    return Observation(
        id=object_id(thing.id, world), kind="object",
        pose=Pose(round(thing.x, 3), round(thing.y, 3), round(thing.z, 3)),
        time=Interval(when, when), name=thing.name,
        caption=object_caption(thing, world) if plan.captions == "truth" else None, source=world.name,
    )  # fmt: skip
