"""The map as a networkx graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

from erag.core.times import format_time
from erag.core.types import EdgeKind, Observation, TopoMap

if TYPE_CHECKING:
    import networkx as nx


def to_networkx(topomap: TopoMap) -> nx.Graph:
    """A graph of the node ids, in order; the graph bears `frame`, edges bear `kind` (lower case) and `metres`.

    Nodes bear `kind`, `x`, `y`, `z`, `sensors`, `source` and, where known, `yaw`, `time` (a stamp), `image`, `name` and
    `caption`.
    """
    import networkx as nx

    graph = nx.Graph(frame=str(topomap.frame))
    graph.add_nodes_from((node.id, _attributes(node)) for node in topomap.nodes)
    edges = topomap.edges
    for a, b, kind, metres in zip(*edges.index.tolist(), edges.kind.tolist(), edges.metres.tolist(), strict=True):
        graph.add_edge(topomap.nodes[a].id, topomap.nodes[b].id, kind=EdgeKind(kind).name.lower(), metres=metres)
    return graph


def _attributes(node: Observation) -> dict[str, object]:
    pose = node.pose
    known = {
        "kind": node.kind,
        "x": pose.x,
        "y": pose.y,
        "z": pose.z,
        "yaw": pose.yaw,
        "time": None if node.time is None else format_time(node.time),
        "image": node.image,
        "name": node.name,
        "caption": node.caption,
        "sensors": dict(node.sensors),
        "source": node.source,
    }
    return {key: value for key, value in known.items() if value is not None}
