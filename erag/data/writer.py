"""Writes a reading as our observation folder (exact round trip, all or nothing) or as GML."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import TypeVar

from erag.core.errors import InputError
from erag.core.output import replacing
from erag.core.types import Interval, Observation
from erag.data.files import check_source, inside, place
from erag.data.gmlwriter import gml_lines
from erag.data.jsonl import CLUSTERS, EDGES, OBSERVATIONS, JsonlReader
from erag.data.meta import FORMAT, META, VERSION, stamp_of
from erag.data.reading import GivenCluster, GivenEdge, Reading
from erag.data.rows import show

_OURS = frozenset({META, OBSERVATIONS, EDGES, CLUSTERS})
T = TypeVar("T")


def write_folder(folder: Path, reading: Reading) -> None:
    """Write a reading, its images included, as an observation folder that reads back the same.

    The folder appears complete or not at all; one of ours is replaced. Raises InputError if `folder` holds anything
    else, if an image is missing, or if the reading holds what a reader would not give back.
    """
    _check_target(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as temporary:
            made = Path(temporary) / "made"
            made.mkdir()
            _fill(made, reading)
            _verify(made, reading, folder)
            if folder.exists():
                folder.rename(Path(temporary) / "replaced")
            made.rename(folder)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", where=place(folder)) from None


def write_gml(path: Path, reading: Reading) -> None:
    """Write map, edges and clusters as one GML file that our reader and networkx read; all of it or nothing.

    Images are named, not copied. Raises InputError if `path` cannot be written or ids clash.
    """
    _check_ids(reading)
    with replacing(path) as file:
        file.writelines(f"{line}\n" for line in gml_lines(reading))


def _check_ids(reading: Reading) -> None:
    """Raises InputError for an id used twice, and for edges and members that are no node or cluster."""
    ids = Counter([o.id for o in reading.observations] + [c.id for c in reading.clusters])
    twice = next((label for label, n in ids.items() if n > 1), None)
    if twice is not None:
        raise InputError(
            f"the id {show(twice)} is used twice", where=reading.source, allowed="one node or cluster each"
        )
    named = [end for e in reading.edges for end in (e.a, e.b)] + [m for c in reading.clusters for m in c.members]
    unknown = next((label for label in named if label not in ids), None)
    if unknown is not None:
        raise InputError(f"an edge or a cluster names {show(unknown)}, which is no node", where=reading.source)


def _check_target(folder: Path) -> None:
    """Refuse to replace anything but a folder that this module wrote."""
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise InputError("is there and is no folder", where=place(folder), repair="another name")
    if not folder.exists() or not any(folder.iterdir()):
        return
    check_source(folder)
    found = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir() or p.is_symlink()}
    foreign = sorted(found - _OURS - _images(folder))
    if foreign or not _OURS & found:
        what = f"the folder holds other files, such as {show(foreign[0]) if foreign else 'an empty folder'}"
        raise InputError(what, where=place(folder), allowed="a new, empty or observation folder", repair="another name")


def _images(folder: Path) -> set[str]:
    """Images of the observation folder that is there; none if it is none."""
    try:
        return {o.image for o in JsonlReader().read(folder).observations if o.image is not None}
    except InputError:
        return set()


def _fill(folder: Path, reading: Reading) -> None:
    head = {"format": FORMAT, "version": VERSION, "name": reading.source, "frame": reading.frame.value}
    sensors = {name: {"min": low, "max": high} for name, (low, high) in reading.sensors.items()}
    extra = {key: value for key, value in (("sensors", sensors), ("notes", list(reading.notes))) if value}
    _write(folder / META, [json.dumps(head | extra, ensure_ascii=False, indent=1)])
    _write(folder / OBSERVATIONS, _json_lines(_observation(o, reading.source) for o in reading.observations))
    if reading.edges:
        _write(folder / EDGES, _json_lines(_edge(e) for e in reading.edges))
    if reading.clusters:
        _write(folder / CLUSTERS, _json_lines(_cluster(c) for c in reading.clusters))
    for image in sorted({o.image for o in reading.observations if o.image is not None}):
        _copy(reading.root, PurePosixPath(image), folder)


def _write(path: Path, lines: Iterable[str]) -> None:
    with path.open("w", encoding="utf-8", errors="surrogatepass", newline="\n") as file:
        file.writelines(f"{line}\n" for line in lines)
        file.flush()
        os.fsync(file.fileno())


def _copy(root: Path, image: PurePosixPath, folder: Path) -> None:
    source, target = root / image, folder / image
    if image.is_absolute() or ".." in image.parts or not inside(root, source) or not source.is_file():
        what = f"the image {show(image.as_posix())} is no file in {root}"
        raise InputError(what, where=place(folder), repair="read the source again, which reports it")
    if image.as_posix() in _OURS:
        raise InputError(f"an image is named {image}, as a file of the format", where=place(root))
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _json_lines(objects: Iterable[Mapping[str, object]]) -> Iterator[str]:
    return (json.dumps(o, ensure_ascii=False) for o in objects)


def _observation(o: Observation, source: str) -> dict[str, object]:
    pose = {"x": float(o.pose.x), "y": float(o.pose.y), "z": float(o.pose.z)}
    optional: dict[str, object] = {
        "time": _time(o.time),
        "image": o.image,
        "name": o.name,
        "caption": o.caption,
        "sensors": {name: float(value) for name, value in o.sensors.items()} or None,
        "source": o.source if o.source != source else None,
    }
    line: dict[str, object] = {"id": o.id, "kind": o.kind}
    line["pose"] = pose if o.pose.yaw is None else pose | {"yaw": float(o.pose.yaw)}
    return line | {key: value for key, value in optional.items() if value is not None}


def _time(time: Interval | None) -> object:
    if time is None:
        return None
    return stamp_of(time) or {"start": float(time.start), "end": float(time.end)}


def _edge(e: GivenEdge) -> dict[str, object]:
    line: dict[str, object] = {"a": e.a, "b": e.b, "kind": e.kind.name.lower()}
    return line if e.metres is None else line | {"metres": float(e.metres)}


def _cluster(c: GivenCluster) -> dict[str, object]:
    line: dict[str, object] = {"id": c.id, "level": int(c.level), "members": list(c.members)}
    optional = {"name": c.name, "summary": c.summary, "relationships": list(c.relationships)}
    return line | {key: value for key, value in optional.items() if value}


def _verify(made: Path, reading: Reading, folder: Path) -> None:
    """Read back what was written. Raises InputError naming the first thing that is not the same."""
    back = JsonlReader().read(made)
    for what, a, b in (
        ("the observation", reading.observations, back.observations),
        ("the edge", reading.edges, back.edges),
        ("the cluster", reading.clusters, back.clusters),
    ):
        differing = _first_difference(a, b)
        if differing is not None:
            told = next((f": {i.what}" for i in back.issues if i.where.endswith(f":{differing + 1}")), "")
            raise InputError(f"{what} {differing + 1} cannot be written as it is{told}", where=place(folder))
    rest = (reading.source, reading.frame, dict(reading.sensors), reading.notes)
    if rest != (back.source, back.frame, dict(back.sensors), back.notes):
        raise InputError(
            f"the name, sensors or notes of {show(reading.source)} are not clean text", where=place(folder)
        )


def _first_difference(a: tuple[T, ...], b: tuple[T, ...]) -> int | None:
    """The first index at which two tuples differ, or None."""
    if a == b:
        return None
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
