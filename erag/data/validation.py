"""The rules every observation is checked by, whatever reader it came from; nothing is repaired, all is reported."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np
import numpy.typing as npt

from erag.core import geometry
from erag.core.errors import InputError
from erag.core.text import MAX_CAPTION, clean
from erag.core.times import parse_interval
from erag.core.types import Frame, Interval, Observation, Pose, Range
from erag.data.files import inside
from erag.data.rows import ROW_OUT, IssueLog, RawRow, number, show

MAX_ID = 200  # characters
MAX_NAME = 500  # characters
MAX_METRES = 1e9  # no coordinate in metres lies further out, so distances stay finite
_MAX_RAW = 25 * MAX_CAPTION  # characters looked at of a longer text
_MAX_PATH = 1000  # characters of an image path
_YEAR_1, _YEAR_9999 = -62_135_596_800.0, 253_402_300_800.0  # UTC seconds that a calendar can show
_FAR, _LOCAL, _SLACK = 1e6, 1e5, 1e3  # metres: away from a map, the extent of a map, around a map
_POLAR = 70.0  # degrees of latitude beyond which a whole map is more likely swapped
_GONE = "is not there"
_FEW = 10  # missing images up to this number are always reported one by one


@dataclass(frozen=True)
class Rules:
    """What rows are checked against: frame, folder of the images, declared sensor ranges, name of the source."""

    frame: Frame
    root: Path
    source: str
    sensors: Mapping[str, Range] = field(default_factory=dict)


def has_controls(text: str) -> bool:
    """Whether `text` has control characters or lone surrogates."""
    return not text.isprintable() and any(unicodedata.category(c) in ("Cc", "Cs") for c in text)


def problem_of_id(value: object) -> str | None:
    """Why `value` cannot be an id, or None if it can: 1 to MAX_ID characters, none of them a control character."""
    if not isinstance(value, str):
        return f"the id is not text: {show(value)}"
    if not value.strip():
        return "the id is empty"
    if len(value) > MAX_ID:
        return f"the id has {len(value):,} characters, more than {MAX_ID}: {show(value, 40)}"
    return f"the id has control characters: {show(value)}" if has_controls(value) else None


def text_of(value: object, what: str, limit: int, line: int, log: IssueLog) -> str | None:
    """A text from the world, cleaned and cut at a word to `limit` characters, or None. What is changed is reported."""
    if value is None:
        return None
    if not isinstance(value, str):
        log.add(line, f"the {what} is not text: {show(value)}", f"kept without {what}")
        return None
    if has_controls(value[:_MAX_RAW].replace("\n", " ").replace("\t", " ").replace("\r", " ")):
        log.add(line, f"control characters in the {what}", "control characters dropped")
    text = clean(value[:_MAX_RAW])
    if not text:
        log.add(line, f"the {what} is empty", f"kept without {what}")
        return None
    if len(text) > limit:
        log.add(line, f"the {what} has {len(value):,} characters", f"{what} cut to {limit} characters")
        text = _cut(text, limit)
    return text


def _cut(text: str, limit: int) -> str:
    """At most `limit` characters, ending with a word where there is one in the second half."""
    end = text.rfind(" ", limit // 2, limit + 1)
    return text[: end if end > 0 else limit].rstrip()


def observations(rows: Iterable[RawRow], rules: Rules, log: IssueLog) -> tuple[Observation, ...]:
    """The usable rows in the order of the source; each one left out is an issue whose action begins with ROW_OUT.

    Raises InputError if no row is usable.
    """
    kept: dict[str, _Kept] = {}
    total = swapped = 0
    for row in rows:
        total += 1
        apart = log.apart()
        made = _observation(row, rules, apart)
        first = kept.get(made.id) if made else None
        if made and first:
            _duplicate(made, row.line, first, log)
            continue
        log.extend(apart.issues)
        if made:
            kept[made.id] = _Kept(row.line, made)
        swapped += made is None and _looks_swapped(row, rules.frame)
    if not kept:
        raise InputError(_nothing(total, swapped, log), where=log.file)
    usable = _without_swapped(list(kept.values()), rules, log)
    return _with_images(usable, rules, log)


@dataclass(frozen=True, slots=True)
class _Kept:
    line: int
    observation: Observation


def _nothing(total: int, swapped: int, log: IssueLog) -> str:
    if not total:
        return "there is no observation in it"
    if swapped == total:
        return f"all {total} positions look swapped: x must be the longitude and y the latitude in degrees"
    first = next((f"{i.where}: {i.what}" for i in log.issues if i.action.startswith(ROW_OUT)), "")
    return f"none of its {total} rows can be used; the first: {first}"


def _duplicate(made: Observation, line: int, first: _Kept, log: IssueLog) -> None:
    same = made == first.observation
    what = f"the id {show(made.id)} of line {first.line} again, " + ("the same row" if same else "with other content")
    log.add(line, what, f"{ROW_OUT}, the first is kept")


def _observation(row: RawRow, rules: Rules, log: IssueLog) -> Observation | None:
    """A row checked, without its image being looked for; None (and one issue) if it has to be left out."""
    problem = problem_of_id(row.id) or _problem_of_kind(row.kind) or _problem_of_position(row, rules.frame)
    if problem:
        log.add(row.line, problem, ROW_OUT)
        return None
    kind: Literal["place", "object"] = "object" if row.kind == "object" else "place"
    return Observation(
        id=str(row.id),
        kind=kind,
        pose=Pose(*_position(row), _yaw(row, log)),
        time=_time(row, log),
        image=_image(row, log),
        name=text_of(row.name, "name", MAX_NAME, row.line, log),
        caption=text_of(row.caption, "caption", MAX_CAPTION, row.line, log),
        sensors=_sensors(row, rules.sensors, log),
        source=text_of(row.source, "source", MAX_NAME, row.line, log) or rules.source,
    )


def _problem_of_kind(kind: object) -> str | None:
    return None if kind in ("place", "object") else f"the kind is {show(kind)}, neither 'place' nor 'object'"


def _position(row: RawRow) -> tuple[float, float, float]:
    x, y, z = (number(v) for v in (row.x, row.y, row.z))
    return (math.nan if x is None else x, math.nan if y is None else y, math.nan if z is None else z)


def _problem_of_position(row: RawRow, frame: Frame) -> str | None:
    if row.x is None and row.y is None:
        return "there is no position"
    x, y, z = _position(row)
    for name, value, given in (("x", x, row.x), ("y", y, row.y), ("z", z, row.z)):
        if not math.isfinite(value):
            return f"{name} is {show(given)}, not a finite number"
    if frame is Frame.WGS84 and _looks_swapped(row, frame):
        return f"longitude {x} and latitude {y} look swapped: a latitude lies within ±90°"
    if frame is Frame.WGS84 and (abs(x) > 180 or abs(y) > 90):
        return f"longitude {x}, latitude {y}: the first lies within ±180°, the second within ±90°"
    if max(abs(x), abs(y), abs(z)) > MAX_METRES:
        return f"the position ({x}, {y}, {z}) lies beyond {MAX_METRES:.0e} m"
    return None


def _looks_swapped(row: RawRow, frame: Frame) -> bool:
    """Whether the latitude is impossible as it is and both numbers are possible the other way round."""
    x, y, _ = _position(row)
    return frame is Frame.WGS84 and 90 < abs(y) <= 180 and abs(x) <= 90


def _yaw(row: RawRow, log: IssueLog) -> float | None:
    if row.yaw is None:
        return None
    yaw = number(row.yaw)
    if yaw is None or not math.isfinite(yaw):
        log.add(row.line, f"the yaw is {show(row.yaw)}, not a finite number", "yaw unknown")
        return None
    return yaw


def _time(row: RawRow, log: IssueLog) -> Interval | None:
    if row.time is None:
        return None
    try:
        time = parse_interval(row.time) if isinstance(row.time, str) else row.time
    except ValueError as error:
        log.add(row.line, str(error) if str(row.time).strip() else "the time is empty", "kept without time")
        return None
    if time.start < _YEAR_1 or time.end > _YEAR_9999:
        log.add(row.line, f"the time {time.start} to {time.end} lies outside the years 1 to 9999", "kept without time")
        return None
    return time


def _sensors(row: RawRow, declared: Mapping[str, Range], log: IssueLog) -> dict[str, float]:
    if row.sensors is None:
        return {}
    if not isinstance(row.sensors, Mapping):
        log.add(row.line, f"the sensors are {show(row.sensors)}, not channels with readings", "readings left out")
        return {}
    readings = {}
    for channel, given in row.sensors.items():
        value = number(given)
        low, high = declared.get(channel, (-math.inf, math.inf))
        if (problem := problem_of_id(channel)) or value is None or not math.isfinite(value):
            what = f"the sensor {show(channel)} reads {show(given)}" if not problem else f"a sensor: {problem}"
            log.add(row.line, what, "reading left out")
        elif not low <= value <= high:
            what = f"the sensor {show(channel)} reads {value}, outside its range {low} to {high}"
            log.add(row.line, what, "reading left out")
        else:
            readings[channel] = value
    return readings


def _image(row: RawRow, log: IssueLog) -> str | None:
    """The image path if it can be one inside the folder; whether the file is there, `_with_images` looks."""
    if row.image is None:
        return None
    if not isinstance(row.image, str) or not row.image or len(row.image) > _MAX_PATH or has_controls(row.image):
        log.add(row.line, f"the image is {show(row.image)}, not a path", "kept without image")
        return None
    path = PurePosixPath(row.image)
    if not path.parts or path.is_absolute() or ".." in path.parts or path.parts[0].endswith(":"):
        log.add(row.line, f"the image {show(row.image)} is no path inside the folder", "kept without image")
        return None
    return path.as_posix()


def _with_images(kept: list[_Kept], rules: Rules, log: IssueLog) -> tuple[Observation, ...]:
    """The observations, without images that are not there; one issue each, or one in all if none is there."""
    stated = [k for k in kept if k.observation.image is not None]
    folders: dict[Path, bool] = {}
    missing = {k.observation.id: why for k in stated if (why := _problem_of_image(k, rules.root, folders))}
    if len(missing) == len(stated) > _FEW and set(missing.values()) == {_GONE}:
        what = f"none of its {len(missing)} images is there, the first: {show(stated[0].observation.image)}"
        log.add(None, what, "observations kept without image")
    else:
        for k in (k for k in stated if k.observation.id in missing):
            what = f"the image {show(k.observation.image)} {missing[k.observation.id]}"
            log.add(k.line, what, "kept without image")
    return tuple(replace(k.observation, image=None) if k.observation.id in missing else k.observation for k in kept)


def _problem_of_image(kept: _Kept, root: Path, folders: dict[Path, bool]) -> str | None:
    """Why the image of a row cannot be used; `folders` remembers which ones lie inside the source."""
    path = root / str(kept.observation.image)
    if path.parent not in folders:
        folders[path.parent] = inside(root, path.parent)
    try:
        if not folders[path.parent] or (path.is_symlink() and not inside(root, path)):
            return "leads out of the folder by a link"
        return None if path.is_file() else _GONE
    except OSError:  # a name too long for this file system
        return _GONE


def _without_swapped(kept: list[_Kept], rules: Rules, log: IssueLog) -> list[_Kept]:
    """WGS84: where most rows lie in one place, those that lie far away but there with x and y swapped are left out."""
    if rules.frame is Frame.METRIC:
        return kept
    xyz = np.array([k.observation.pose.xyz for k in kept])  # (n, 3)
    swapped = _swapped(xyz)
    for k in (kept[i] for i in np.flatnonzero(swapped)):
        x, y, _ = k.observation.pose.xyz
        what = f"longitude {x} and latitude {y} look swapped: they lie far from the other rows, swapped among them"
        log.add(k.line, what, ROW_OUT)
    if (np.abs(xyz[~swapped, 1]) > _POLAR).all() and (np.abs(xyz[~swapped, 0]) <= _POLAR).all():
        what = f"all latitudes lie beyond ±{_POLAR:.0f}°: x (longitude) and y (latitude) look swapped"
        log.add(None, what, "kept as they are; if they are swapped, swap them in the source and read it again")
    return [k for k, out in zip(kept, swapped, strict=True) if not out]


def _swapped(xyz: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """(n,) bool: rows of (n, 3) degrees that only fit to the others, a local majority, with x and y swapped."""
    flat = xyz * (1.0, 1.0, 0.0)
    middle = np.median(flat, axis=0)
    away = geometry.distance(Frame.WGS84, flat, middle)  # (n,) metres
    far = away > _FAR
    extent = away[~far].max(initial=0.0)
    if 2 * far.sum() >= len(xyz) or extent > _LOCAL:
        return np.zeros(len(xyz), np.bool_)
    possible = np.abs(xyz[:, 0]) <= 90  # as a latitude
    there = geometry.distance(Frame.WGS84, flat[:, [1, 0, 2]], middle) <= 2 * extent + _SLACK
    return np.asarray(far & possible & there)
