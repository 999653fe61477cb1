"""GeoJSON (RFC 7946): nodes as points, edges as lines, clusters as points at the centroid of their nodes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from erag.core.geometry import centroid
from erag.core.output import replacing
from erag.core.times import format_time
from erag.core.types import Observation
from erag.data.reading import GivenCluster, Reading


def write_geojson(path: Path, reading: Reading) -> None:
    """Write `reading` to `path`, complete or not at all. Metric positions stay local metres; `frame` says which."""
    body = {"type": "FeatureCollection", "frame": reading.frame.value, "features": list(_features(reading))}
    with replacing(path) as file:
        file.write(json.dumps(body, ensure_ascii=False, allow_nan=False))


def _features(reading: Reading) -> Iterator[dict[str, Any]]:
    nodes = {o.id: o for o in reading.observations}
    for node in reading.observations:
        yield _feature("Point", _coordinates(node), {"id": node.id, "type": node.kind, **_node_properties(node)})
    for edge in reading.edges:
        line = [_coordinates(nodes[edge.a]), _coordinates(nodes[edge.b])]
        properties = {"a": edge.a, "b": edge.b, "kind": edge.kind.name.lower(), "metres": edge.metres}
        yield _feature("LineString", line, {"type": "edge", **properties})
    below = _nodes_below(reading.clusters)
    for cluster in reading.clusters:
        positions = np.array([nodes[i].pose.xyz for i in below[cluster.id] if i in nodes])
        if len(positions):
            yield _feature("Point", list(centroid(reading.frame, positions)), _cluster_properties(cluster))


def _feature(kind: str, coordinates: list[Any], properties: dict[str, Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _coordinates(node: Observation) -> list[float]:
    return list(node.pose.xyz)


def _node_properties(node: Observation) -> dict[str, Any]:
    time = None if node.time is None else format_time(node.time)
    found = {"name": node.name, "caption": node.caption, "time": time, "yaw": node.pose.yaw, "image": node.image}
    return {**{k: v for k, v in found.items() if v is not None}, "sensors": dict(node.sensors)}


def _cluster_properties(c: GivenCluster) -> dict[str, Any]:
    texts = {"name": c.name, "summary": c.summary, "relationships": list(c.relationships)}
    return {"type": "cluster", "id": c.id, "level": c.level, "members": list(c.members), **texts}


def _nodes_below(clusters: tuple[GivenCluster, ...]) -> dict[str, list[str]]:
    """For each cluster the ids of the nodes below it; a cluster that is its own ancestor is followed once."""
    members = {c.id: c.members for c in clusters}
    below: dict[str, list[str]] = {}
    for root in members:
        found, todo, seen = [], [root], {root}
        while todo:
            for member in members[todo.pop()]:
                if member in members and member not in seen:
                    seen.add(member)
                    todo.append(member)
                elif member not in members:
                    found.append(member)
        below[root] = found
    return below
