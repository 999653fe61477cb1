"""A reading as lines of GML in our own dialect, which networkx reads as well."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from erag.core.types import Interval, Observation
from erag.data.meta import FORMAT, VERSION, stamp_of
from erag.data.reading import GivenCluster, Reading

MEMBER = "member"  # kind of the edges that lead from a child to the cluster above it
_ESCAPED = re.compile(r'[^ -~]|[&"]')


def gml_lines(reading: Reading) -> Iterator[str]:
    """The lines of a GML file: the graph's attributes, nodes, clusters as nodes, edges, child → parent edges."""
    ids = [o.id for o in reading.observations] + [c.id for c in reading.clusters]
    rows = {label: i for i, label in enumerate(ids)}
    pairs = [frozenset((e.a, e.b)) for e in reading.edges]
    yield "graph ["
    yield "  directed 0"
    if len(set(pairs)) < len(pairs):
        yield "  multigraph 1"  # two nodes joined by edges of two kinds
    yield from _head(reading)
    for observation in reading.observations:
        yield from _observation(observation, rows[observation.id], reading.source)
    for cluster in reading.clusters:
        yield from _cluster(cluster, rows[cluster.id])
    for edge in reading.edges:
        metres = [] if edge.metres is None else [f"metres {_real(edge.metres)}"]
        yield from _edge(rows[edge.a], rows[edge.b], edge.kind.name.lower(), metres)
    for cluster in reading.clusters:
        for member in cluster.members:
            yield from _edge(rows[member], rows[cluster.id], MEMBER, [])
    yield "]"


def _head(reading: Reading) -> Iterator[str]:
    yield f'  format "{FORMAT}"'
    yield f"  version {VERSION}"
    yield f"  name {_text(reading.source)}"
    yield f'  frame "{reading.frame.value}"'
    for name, (low, high) in reading.sensors.items():
        yield f"  sensor [ name {_text(name)} min {_real(low)} max {_real(high)} ]"
    for note in reading.notes:
        yield f"  note {_text(note)}"


def _observation(o: Observation, row: int, source: str) -> Iterator[str]:
    yield "  node ["
    yield f"    id {row}"
    yield f"    label {_text(o.id)}"
    yield f'    type "{o.kind}"'
    yield f"    position [ x {_real(o.pose.x)} y {_real(o.pose.y)} z {_real(o.pose.z)} ]"
    if o.pose.yaw is not None:
        yield f"    yaw {_real(o.pose.yaw)}"
    if o.time is not None:
        yield f"    time {_time(o.time)}"
    texts = {"image": o.image, "name": o.name, "caption": o.caption, "source": o.source if o.source != source else None}
    yield from (f"    {key} {_text(value)}" for key, value in texts.items() if value is not None)
    yield from _sensors(o.sensors)
    yield "  ]"


def _sensors(readings: Mapping[str, float]) -> Iterator[str]:
    for name, value in readings.items():
        yield f"    sensor [ name {_text(name)} value {_real(value)} ]"


def _cluster(c: GivenCluster, row: int) -> Iterator[str]:
    yield "  node ["
    yield f"    id {row}"
    yield f"    label {_text(c.id)}"
    yield '    type "cluster"'
    yield f"    level {int(c.level)}"
    yield from (f"    members {_text(member)}" for member in c.members)
    yield from (f"    {key} {_text(value)}" for key, value in (("name", c.name), ("summary", c.summary)) if value)
    yield from (f"    relationships {_text(said)}" for said in c.relationships)
    yield "  ]"


def _edge(a: int, b: int, kind: str, attributes: list[str]) -> Iterator[str]:
    yield "  edge ["
    yield from (f"    {line}" for line in (f"source {a}", f"target {b}", f'kind "{kind}"', *attributes))
    yield "  ]"


def _time(time: Interval) -> str:
    stamp = stamp_of(time)
    return _text(stamp) if stamp else f"[ start {_real(time.start)} end {_real(time.end)} ]"


def _text(value: str) -> str:
    """A quoted text in which only printable ASCII stands as it is."""
    return '"' + _ESCAPED.sub(lambda m: f"&#{ord(m[0])};", value) + '"'


def _real(value: float) -> str:
    """The shortest exact form of a number, with the decimal point that networkx asks for."""
    mantissa, e, exponent = repr(float(value)).partition("e")
    return f"{mantissa if '.' in mantissa else f'{mantissa}.0'}{e.upper()}{exponent}"
