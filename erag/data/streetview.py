"""The authors' street view GML: panoramas in WGS84 with captions and month stamps, and the forest built over them."""

from __future__ import annotations

import math
from pathlib import Path

from erag.core.types import Frame
from erag.data import dialect
from erag.data.dialect import Nodes, Parts
from erag.data.files import source_name
from erag.data.gml import GmlGraph, GmlRecord
from erag.data.reading import Reading
from erag.data.rows import IssueLog, RawRow, number, show
from erag.data.validation import Rules, observations

TYPES = frozenset({"street_view", "base"})
_USED = frozenset(
    {"id", "label", "type", "level", "position", "x", "y", "z", "name", "caption", "timestamp", "image_path"}
    | {"members", "summary", "relationships", "base_heading"}
)


def read(graph: GmlGraph, path: Path, log: IssueLog) -> Reading:
    """A street view map or forest: x = longitude, y = latitude, `timestamp` a month, `base_heading` a compass bearing.

    Where every heading of the file is the same 0 it was never recorded, and yaw is unknown. Raises InputError if no
    row is usable.
    """
    nodes = dialect.split(graph, log)
    has_yaw, notes = _headings(nodes)
    rows = (_row(label, record, has_yaw, log) for label, record in nodes.leaves)
    rules = Rules(Frame.WGS84, path.parent, source_name(path))
    kept = observations(rows, rules, log)
    clusters = dialect.forest(nodes, dialect.links(graph, nodes, log), log)
    notes += dialect.unused(graph, _USED)
    return dialect.reading(Parts(Frame.WGS84, kept, clusters=clusters, notes=notes), path, log)


def _headings(nodes: Nodes) -> tuple[bool, tuple[str, ...]]:
    """Whether the headings of the file say anything, and a note on it."""
    stated = [h for _, record in nodes.leaves if (h := record.get("base_heading")) is not None]
    if not stated:
        return False, ()
    if all(h == 0 for h in stated):
        return False, (f"yaw is unknown: base_heading is 0 at all {len(stated)} nodes that state it",)
    return True, ("yaw is computed from base_heading, degrees clockwise from north",)


def _row(label: str, record: GmlRecord, has_yaw: bool, log: IssueLog) -> RawRow:
    x, y, z = dialect.position(record)
    return RawRow(
        line=record.line,
        id=label,
        x=x,
        y=y,
        z=z,
        yaw=_yaw(record, log) if has_yaw else None,
        time=dialect.stamp(record.get("timestamp")),
        image=record.get("image_path"),
        name=record.get("name"),
        caption=record.get("caption"),
    )


def _yaw(record: GmlRecord, log: IssueLog) -> float | None:
    """Radians from east, counter-clockwise, in (-π, π], of a compass bearing."""
    given = record.get("base_heading")
    heading = number(given)
    if given is None:
        return None
    if heading is None or not math.isfinite(heading):
        log.add(record.line, f"base_heading is {show(given)}, not a finite number", "yaw unknown")
        return None
    yaw = math.radians((90.0 - heading) % 360.0)
    return yaw - 2 * math.pi if yaw > math.pi else yaw
