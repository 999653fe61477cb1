"""What the GML dialects share: labels, positions, ends of edges, clusters with child → parent edges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from erag.core.types import Frame, Observation
from erag.data import structure
from erag.data.files import source_name
from erag.data.gml import GmlGraph, GmlRecord, GmlValue, repeated
from erag.data.reading import GivenCluster, GivenEdge, Reading
from erag.data.rows import EDGE_OUT, ROW_OUT, IssueLog, RawCluster, RawEdge, show

CLUSTER = "cluster"
# Keys that mean one thing: a record that states one of them twice says two things at once.
_ONCE = frozenset(
    {"id", "label", "type", "kind", "position", "x", "y", "z", "yaw", "base_heading", "name", "caption", "summary"}
    | {"timestamp", "time", "level", "image", "image_path", "source", "target", "metres", "distance", "relationship"}
)
_SHOWN_KEYS = 20


@dataclass(frozen=True)
class Nodes:
    """The node records of a graph that have a label, parted into leaves and clusters, and GML number -> record."""

    leaves: tuple[tuple[str, GmlRecord], ...]
    clusters: tuple[tuple[str, GmlRecord], ...]
    labels: Mapping[GmlValue, str]


@dataclass(frozen=True, slots=True)
class Link:
    """An edge record with the labels of its ends."""

    record: GmlRecord
    a: str
    b: str


def split(graph: GmlGraph, log: IssueLog) -> Nodes:
    """Part the node records; those that state a key twice or have neither label nor number are left out, reported."""
    leaves: list[tuple[str, GmlRecord]] = []
    inner: list[tuple[str, GmlRecord]] = []
    labels: dict[GmlValue, str] = {}
    for record in graph.nodes:
        label = label_of(record)
        if (key := repeated(record, _ONCE)) or label is None:
            what = f"the node states {key!r} twice" if key else "the node has neither a label nor an id"
            log.add(record.line, what, ROW_OUT)
            continue
        number = record.get("id")
        if number is not None and not isinstance(number, GmlRecord):
            if number in labels:
                what = f"the node {show(label)} has the GML id {show(number)} of {show(labels[number])}"
                log.add(record.line, what, f"row kept; edges with this id mean {show(labels[number])}")
            labels.setdefault(number, label)
        (inner if record.get("type") == CLUSTER else leaves).append((label, record))
    return Nodes(tuple(leaves), tuple(inner), labels)


def label_of(record: GmlRecord) -> str | None:
    """The source's own id: the label, or the GML number where there is no label."""
    for key in ("label", "id"):
        value = record.get(key)
        if value is not None:
            return None if isinstance(value, GmlRecord) else str(value)
    return None


def position(record: GmlRecord) -> tuple[GmlValue | None, GmlValue | None, GmlValue]:
    """x, y and z as the record has them, in a list `position` or directly; z is 0 where it is not stated."""
    held = record.get("position")
    at = held if isinstance(held, GmlRecord) else record
    z = at.get("z")
    return (at.get("x"), at.get("y"), 0.0 if z is None else z)


def text(record: GmlRecord, *keys: str) -> GmlValue | None:
    """The first of `keys` that the record states."""
    return next((value for key in keys if (value := record.get(key)) is not None), None)


def stamp(value: GmlValue | None) -> str | None:
    """A time stamp as text: a year may stand there as a number."""
    return None if value is None else str(value) if not isinstance(value, GmlRecord) else "a list"


def links(graph: GmlGraph, nodes: Nodes, log: IssueLog) -> list[Link]:
    """The edge records whose ends are nodes of the file; others are reported and left out."""
    found = []
    for record in graph.edges:
        ends = (record.get("source"), record.get("target"))
        a, b = (None if isinstance(end, GmlRecord | None) else nodes.labels.get(end) for end in ends)
        if (key := repeated(record, _ONCE)) or a is None or b is None:
            missing = show(ends[0] if a is None else ends[1])
            what = f"states {key!r} twice" if key else f"ends at {missing}, which is no node or was left out"
            log.add(record.line, f"the edge {show(ends[0])} - {show(ends[1])} {what}", EDGE_OUT)
            continue
        found.append(Link(record, a, b))
    return found


def forest(nodes: Nodes, parents: Iterable[Link], log: IssueLog) -> tuple[RawCluster, ...]:
    """Clusters with the members that child → parent edges give them.

    Edges are trusted; a list of `members` that differs is reported, and used only where no edge leads to the cluster.
    """
    level = {label: record.get("level") for label, record in nodes.clusters}
    below: dict[str, list[str]] = {label: [] for label, _ in nodes.clusters}
    for link in parents:
        if link.b not in below or _level(level.get(link.a)) >= _level(level[link.b]):
            what = f"the edge {show(link.a)} - {show(link.b)} does not lead from a child to the cluster above it"
            log.add(link.record.line, what, EDGE_OUT)
        else:
            below[link.b].append(link.a)
    return tuple(_cluster(label, record, below[label], log) for label, record in nodes.clusters)


def _level(value: GmlValue | None) -> float:
    return value if isinstance(value, int | float) else 0


def _cluster(label: str, record: GmlRecord, below: list[str], log: IssueLog) -> RawCluster:
    stated = [str(m) for m in record.all("members") if not isinstance(m, GmlRecord)]
    members = below or stated
    if stated and sorted(stated) != sorted(below):
        differing = sorted(set(stated) ^ set(below))
        what = f"the cluster {show(label)} lists {len(stated)} members, its edges say {len(below)}"
        what += f"; they differ in {', '.join(show(d) for d in differing[:3])}" if differing else ""
        log.add(record.line, what, "the edges are used" if below else "the list is used")
    return RawCluster(
        record.line,
        label,
        record.get("level"),
        tuple(members),
        record.get("name"),
        record.get("summary"),
        record.all("relationships"),
    )


@dataclass(frozen=True)
class Parts:
    """What a dialect makes of a graph, before edges and clusters are checked."""

    frame: Frame
    observations: tuple[Observation, ...]
    edges: tuple[RawEdge, ...] = ()
    clusters: tuple[RawCluster, ...] = ()
    notes: tuple[str, ...] = ()


def reading(parts: Parts, path: Path, log: IssueLog) -> Reading:
    """Check edges and clusters, and put everything together."""
    ids = {o.id for o in parts.observations}
    edges: tuple[GivenEdge, ...] = structure.edges(parts.edges, ids, log)
    clusters: tuple[GivenCluster, ...] = structure.clusters(parts.clusters, ids, log)
    return Reading(
        source=source_name(path),
        root=path.parent,
        frame=parts.frame,
        observations=parts.observations,
        edges=edges,
        clusters=clusters,
        issues=tuple(log.issues),
        notes=parts.notes,
    )


def unused(graph: GmlGraph, used: frozenset[str]) -> tuple[str, ...]:
    """A note that names the attributes of nodes which this memory has no place for, if there are any."""
    names = sorted({key for record in graph.nodes for key, _ in record.items} - used)
    if not names:
        return ()
    more = f" and {len(names) - _SHOWN_KEYS} more" if len(names) > _SHOWN_KEYS else ""
    return (f"attributes of nodes not kept: {', '.join(names[:_SHOWN_KEYS])}{more}",)
