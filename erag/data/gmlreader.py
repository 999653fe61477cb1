"""The `gml` reader: recognises the dialect of a GML file and reads our own; others are refused with what to state."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from erag.core.errors import InputError
from erag.core.types import Frame, Interval, Range
from erag.data import airsim, dialect, streetview
from erag.data.dialect import Link, Parts
from erag.data.files import head, place, read_text, source_name
from erag.data.gml import GmlGraph, GmlRecord, GmlValue, parse
from erag.data.meta import FORMAT, VERSION, frame_of, interval_of, notes_of, range_of
from erag.data.reading import Reading
from erag.data.rows import IssueLog, RawEdge, RawRow, show
from erag.data.validation import MAX_NAME, Rules, observations, text_of

_USED = frozenset(
    {"id", "label", "type", "kind", "position", "x", "y", "z", "yaw", "time", "timestamp", "image", "image_path"}
    | {"name", "caption", "sensor", "source", "level", "members", "summary", "relationships"}
)
_GRAPH = re.compile(r"\b(?:graph|node)\s*\[")
_REPAIR = 'add `frame "wgs84"` (x = longitude, y = latitude) or `frame "metric"` (metres) to the graph'


class GmlReader:
    """GML files: the authors' street view and AirSim dialects, our export, and any graph that states its frame."""

    kind = "gml"

    def sniff(self, path: Path) -> bool:
        return path.is_file() and (path.suffix.lower() == ".gml" or bool(_GRAPH.search(head(path))))

    def read(self, path: Path) -> Reading:
        """Read a GML file. Raises InputError if it has no usable node or does not say what its numbers mean."""
        log = IssueLog(path.name)
        graph = parse(read_text(path, log), path.name)
        log.extend(graph.issues)
        if not graph.nodes:
            first = f"; {log.issues[0].where}: {log.issues[0].what}" if log.issues else ""
            raise InputError(f"there is no node in it{first}", where=place(path), allowed="graph [ node [ ... ] ]")
        types = {str(record.get("type")) for record in graph.nodes}
        if graph.attributes.get("frame") is not None:
            return _read_stated(graph, path, log)
        if types & streetview.TYPES:
            return streetview.read(graph, path, log)
        if types & airsim.TYPES:
            return airsim.read(graph, path, log)
        raise InputError("the file does not say in which frame its positions are", where=place(path), repair=_REPAIR)


def _read_stated(graph: GmlGraph, path: Path, log: IssueLog) -> Reading:
    """A graph that states its frame: our own export, or another's with positions, names and captions."""
    source, frame, sensors = _stated(graph.attributes, path, log)
    nodes = dialect.split(graph, log)
    rules = Rules(frame, path.parent, source, sensors)
    kept = observations((_row(label, record, log) for label, record in nodes.leaves), rules, log)
    inner = {label for label, _ in nodes.clusters}
    links = dialect.links(graph, nodes, log)
    edges = [link for link in links if link.a not in inner and link.b not in inner]
    unkind = sum(_kind(link) is None for link in edges)
    notes = notes_of(graph.attributes.all("note"), log)
    notes += (f"{unkind} edges that state no kind are read as path edges",) if unkind else ()
    parts = Parts(
        frame=frame,
        observations=kept,
        edges=tuple(_edge(link) for link in edges),
        clusters=dialect.forest(nodes, [link for link in links if link.a in inner or link.b in inner], log),
        notes=notes + dialect.unused(graph, _USED),
    )
    return replace(dialect.reading(parts, path, log), source=source, sensors=sensors)


def _stated(attributes: GmlRecord, path: Path, log: IssueLog) -> tuple[str, Frame, dict[str, Range]]:
    """Name, frame and sensor ranges that the graph states. Raises InputError for what cannot be one."""
    own = attributes.get("format") == FORMAT
    if own and attributes.get("version") != VERSION:
        what = f"version {show(attributes.get('version'))} of {FORMAT}"
        raise InputError(what, where=place(path), allowed=str(VERSION))
    frame = frame_of(attributes.get("frame"), place(path))
    name = attributes.get("name") if own else None
    sensors = {}
    for record in attributes.all("sensor"):
        if not isinstance(record, GmlRecord):
            raise InputError("a sensor is no list", where=place(path), allowed='sensor [ name "ndvi" min -1 max 1 ]')
        channel = record.get("name")
        sensors[str(channel)] = range_of(channel, record.get("min"), record.get("max"), place(path))
    return (text_of(name, "name", MAX_NAME, attributes.line, log) or source_name(path), frame, sensors)


def _row(label: str, record: GmlRecord, log: IssueLog) -> RawRow:
    x, y, z = dialect.position(record)
    kind = dialect.text(record, "type", "kind")
    return RawRow(
        line=record.line,
        id=label,
        kind="object" if kind == "object" else "place",
        x=x,
        y=y,
        z=z,
        yaw=record.get("yaw"),
        time=_time(dialect.text(record, "time", "timestamp"), record.line, log),
        image=dialect.text(record, "image", "image_path"),
        name=record.get("name"),
        caption=record.get("caption"),
        sensors=_readings(record, log),
        source=record.get("source"),
    )


def _time(value: GmlValue | None, line: int, log: IssueLog) -> Interval | str | None:
    """A stamp as it is, or `time [ start end ]` in UTC seconds."""
    if isinstance(value, GmlRecord):
        return interval_of(value.get("start"), value.get("end"), line, log)
    return dialect.stamp(value)


def _readings(record: GmlRecord, log: IssueLog) -> dict[str, object]:
    """Readings of repeated `sensor [ name value ]` lists."""
    readings: dict[str, object] = {}
    for held in record.all("sensor"):
        channel = held.get("name") if isinstance(held, GmlRecord) else None
        if not isinstance(held, GmlRecord) or not isinstance(channel, str) or channel in readings:
            log.add(record.line, f"the sensor {show(channel)} has no name or is stated twice", "reading left out")
            continue
        readings[channel] = held.get("value")
    return readings


def _kind(link: Link) -> GmlValue | None:
    return dialect.text(link.record, "kind", "type")


def _edge(link: Link) -> RawEdge:
    metres = dialect.text(link.record, "metres", "distance")
    kind = _kind(link)
    return RawEdge(link.record.line, link.a, link.b, "path" if kind is None else kind, metres)
