"""The authors' AirSim GML: objects of a simulated building in metres, drone poses with a path, areas as clusters."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from erag.core.types import Frame
from erag.data import dialect
from erag.data.dialect import Link, Nodes, Parts
from erag.data.files import source_name
from erag.data.gml import GmlGraph, GmlRecord
from erag.data.reading import Reading
from erag.data.rows import EDGE_OUT, IssueLog, RawEdge, RawRow, show
from erag.data.validation import Rules, observations

DRONE, OBJECT = "drone", "object"
TYPES = frozenset({DRONE, OBJECT})
_USED = frozenset({"id", "label", "type", "level", "position", "x", "y", "z", "yaw", "name", "caption", "summary"})
_SCENE_LOGGER = "direct_scene_logger"


def read(graph: GmlGraph, path: Path, log: IssueLog) -> Reading:
    """A map of objects, and of drone poses if it has any; coordinates stay as the file has them.

    `drone_path` edges become path edges with their distance, `part_of` edges the forest; relations between objects
    (`spatial`) are no ways and are only counted. Raises InputError if no row is usable.
    """
    nodes = dialect.split(graph, log)
    rules = Rules(Frame.METRIC, path.parent, source_name(path))
    kept = observations((_row(label, record) for label, record in nodes.leaves), rules, log)
    paths, parents, relations = _sort(dialect.links(graph, nodes, log), log)
    notes = _frame_notes(graph, nodes)
    if relations:
        notes += (f"{relations} spatial relations between objects are not edges of the map",)
    parts = Parts(
        frame=Frame.METRIC,
        observations=kept,
        edges=tuple(RawEdge(e.record.line, e.a, e.b, "path", e.record.get("distance")) for e in paths),
        clusters=dialect.forest(nodes, parents, log),
        notes=notes + dialect.unused(graph, _USED | {"members", "relationships"}),
    )
    return dialect.reading(parts, path, log)


def _row(label: str, record: GmlRecord) -> RawRow:
    x, y, z = dialect.position(record)
    is_object = record.get("type") == OBJECT
    return RawRow(
        line=record.line,
        id=label,
        kind="object" if is_object else "place",
        x=x,
        y=y,
        z=z,
        yaw=None if is_object else record.get("yaw"),
        name=dialect.text(record, "name") or label if is_object else record.get("name"),
        caption=_caption(record),
    )


def _caption(record: GmlRecord) -> object:
    """The caption, or the summary unless it only repeats the name (`Object: name`)."""
    summary = record.get("summary")
    names = {f"Object: {record.get(key)}" for key in ("name", "label")}
    return dialect.text(record, "caption") or (None if summary in names else summary)


def _sort(links: list[Link], log: IssueLog) -> tuple[list[Link], list[Link], int]:
    """Path edges, child → parent edges, and the number of relations between objects; other edges are reported."""
    paths, parents = [], []
    counts: Counter[str] = Counter()
    for link in links:
        kind = link.record.get("type")
        if kind == "drone_path":
            paths.append(link)
        elif link.record.get("relationship") == "part_of":
            parents.append(link)
        elif kind == "spatial":
            counts["spatial"] += 1
        else:
            what = f"the edge {show(link.a)} - {show(link.b)} has the unknown type {show(kind)}"
            log.add(link.record.line, what, EDGE_OUT)
    return paths, parents, counts["spatial"]


def _frame_notes(graph: GmlGraph, nodes: Nodes) -> tuple[str, ...]:
    """Which way z points: down where a drone wrote the file (NED), up where the scene was logged directly.

    Measured on the two files of one building: x and y agree, z has the opposite sign.
    """
    if graph.attributes.get("creation_method") == _SCENE_LOGGER:
        return ("coordinates as in the file: z points up, and the frame is left-handed (the engine's own axes)",)
    if any(record.get("type") == DRONE for _, record in nodes.leaves):
        return ("coordinates as in the file: z points down (AirSim's north-east-down frame), yaw turns from +x to +y",)
    return ("coordinates as in the file: which way z points it does not say",)
