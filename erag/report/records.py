"""What the page's script reads: nodes, clusters and questions as short JSON rows, in the order of the map's rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from erag.core.text import clean
from erag.core.times import format_time
from erag.core.types import NO_PARENT, Cluster, Forest, Frame, Observation, TopoMap
from erag.report.chart import Chart
from erag.report.questions import QuestionView
from erag.report.tree import leaf_counts, title_of


def records(
    topomap: TopoMap, forest: Forest, drawn: Chart, questions: Sequence[QuestionView], pictures: Mapping[int, str]
) -> dict[str, Any]:
    """Plain values; the keys are those that `page.js` reads."""
    counts = leaf_counts(forest)
    n = forest.n_leaves
    above = [int(p) - n if p != NO_PARENT else -1 for p in forest.parent]
    return {
        "unit": drawn.plane.metres_per_unit,
        "size": [drawn.plane.width, drawn.plane.height],
        "nodes": [
            _node(node, drawn.points[row].tolist(), above[row], topomap.frame) for row, node in enumerate(topomap.nodes)
        ],
        "clusters": [
            _cluster(cluster, drawn.centres[i].tolist(), above[n + i], counts[n + i])
            for i, cluster in enumerate(forest.clusters)
        ],
        "questions": [_question(view, drawn) for view in questions],
        "pictures": {str(row): picture for row, picture in pictures.items()},
    }


def _node(node: Observation, point: Sequence[int], above: int, frame: Frame) -> list[Any]:
    """[id, name, caption, time, readings, x, y, cluster, is object, position]."""
    name = clean(node.name or "")
    readings = [[clean(channel), float(f"{value:.6g}")] for channel, value in sorted(node.sensors.items())]
    time = format_time(node.time) if node.time is not None else ""
    place = _position(node, frame)
    return [
        clean(node.id), name if name != node.id else "", clean(node.caption or ""), time, readings, *point, above,
        int(node.kind == "object"), place,
    ]  # fmt: skip


def _position(node: Observation, frame: Frame) -> str:
    x, y, z = node.pose.xyz
    if frame is Frame.METRIC:
        return f"{x:.2f}, {y:.2f}, {z:.2f} m"
    return f"{y:.6f}°, {x:.6f}°" + (f", {z:.1f} m" if z else "")


def _cluster(cluster: Cluster, point: Sequence[int], above: int, views: int) -> list[Any]:
    """[id, title, level, cluster above, views, x, y]."""
    return [clean(cluster.id), title_of(cluster), cluster.level, above, views, *point]


def _question(view: QuestionView, drawn: Chart) -> dict[str, Any]:
    start = None if view.start is None else drawn.plane.points(np.array([view.start])).tolist()[0]
    hits = [hit.row for hit in view.hits] if view.status in ("find", "explain") else []
    return {
        "start": start,
        "goal": view.goal,
        "way": list(view.way),
        "hits": hits,
        "seen": [r for r, _ in view.evidence],
    }
