"""A forest as a networkx graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from erag.core.text import node_text
from erag.core.types import NO_PARENT, Cluster, Forest, Observation, TopoMap

if TYPE_CHECKING:
    import networkx as nx


def to_networkx(forest: Forest, topomap: TopoMap) -> nx.DiGraph[str]:
    """Edges from parent to child; nodes carry plain values that any writer of networkx takes.

    All: `level`, `kind` (`cluster`, `place`, `object`), `x`, `y`, `z` in the map's frame, `text`, `sensors`. Clusters
    also `name`, `mean_distance` in metres, `leaves` (how many base nodes), `relationships`. The graph has `frame`.
    """
    import networkx as nx

    graph: nx.DiGraph[str] = nx.DiGraph(frame=topomap.frame.value)
    for node in topomap.nodes:
        graph.add_node(node.id, **_leaf(node))
    below = _leaves_below(forest)
    for at, cluster in enumerate(forest.clusters, forest.n_leaves):
        graph.add_node(cluster.id, **_cluster(cluster), leaves=below[at])
    for child, parent in enumerate(forest.parent):
        if parent != NO_PARENT:
            graph.add_edge(forest.ids[parent], forest.ids[child])
    return graph


def _leaf(node: Observation) -> dict[str, Any]:
    x, y, z = node.pose.xyz
    text = node_text(node.name, node.caption)
    return {"level": 0, "kind": node.kind, "x": x, "y": y, "z": z, "text": text, "sensors": dict(node.sensors)}


def _cluster(cluster: Cluster) -> dict[str, Any]:
    x, y, z = cluster.position
    return {
        "level": cluster.level,
        "kind": "cluster",
        "x": x,
        "y": y,
        "z": z,
        "text": cluster.summary,
        "sensors": dict(cluster.sensors),
        "name": cluster.name,
        "mean_distance": cluster.mean_distance,
        "relationships": list(cluster.relationships),
    }


def _leaves_below(forest: Forest) -> list[int]:
    """Base nodes below each row. Clusters come after their members, by level."""
    count = [1] * forest.n_leaves + [0] * len(forest.clusters)
    for row, parent in enumerate(forest.parent):
        if parent != NO_PARENT:
            count[parent] += count[row]
    return count
