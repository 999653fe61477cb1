"""The COEX folder: frames of a real walk with 6-DoF poses, captions as JSON strings, sequence and proximity edges."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from erag.core.errors import InputError
from erag.core.types import Frame, Interval
from erag.data import jsontext, structure
from erag.data.files import head, place, read_optional, read_text, source_name
from erag.data.jsontext import Item
from erag.data.reading import Reading
from erag.data.rows import CLUSTER_OUT, EDGE_OUT, ROW_OUT, IssueLog, RawCluster, RawEdge, RawRow, number, show
from erag.data.validation import Rules, observations

GRAPH, NODES, EDGES = "topological_graph.json", "nodes_with_captions.json", "edges.json"
FOREST = "semantic_forest*.json"
_EDGE_KINDS = {"sequence": "path", "proximity": "radius"}
_LEAF = "leaf"
_LIST = " Objects: "  # before the objects of a caption, as read
_NOTES = (
    "yaw is that of the camera's optical axis: quaternions are x, y, z, w from camera (z ahead) to world (z up)",
    "time stamps are microseconds since 1970",
)


class CoexReader:
    """A folder with `topological_graph.json`, or `nodes_with_captions.json` and `edges.json`; and perhaps a forest."""

    kind = "coex"

    def sniff(self, path: Path) -> bool:
        if path.is_dir():
            return any((path / name).is_file() for name in (GRAPH, NODES))
        return path.suffix == ".json" and '"node_id"' in head(path) and '"quaternion"' in head(path)

    def read(self, path: Path) -> Reading:
        """Read the folder, or the folder of one of its files. Raises InputError if no row is usable."""
        folder = path if path.is_dir() else path.parent
        log = IssueLog(NODES)
        nodes, edge_items, node_log, edge_log = _graph(folder, path, log)
        rules = Rules(Frame.METRIC, folder, source_name(folder))
        rows = (row for item in nodes if (row := _row(item, node_log)))
        kept = observations(rows, rules, node_log)
        ids = {o.id for o in kept}
        edges = structure.edges((e for item in edge_items if (e := _edge(item, edge_log))), ids, edge_log)
        raw, forest_log = _forest(folder, {o.id: o.image for o in kept}, log)
        return Reading(
            source=rules.source,
            root=folder,
            frame=Frame.METRIC,
            observations=kept,
            edges=edges,
            clusters=structure.clusters(raw, ids, forest_log),
            issues=tuple(log.issues),
            notes=_NOTES,
        )


def _graph(folder: Path, path: Path, log: IssueLog) -> tuple[list[Item], list[Item], IssueLog, IssueLog]:
    """Items of nodes and of edges, and the logs of the files they stand in."""
    if (folder / GRAPH).is_file():
        graph_log = log.beside(GRAPH)
        found = _document(folder / GRAPH, graph_log, folder)
        if found.get("nodes"):
            return found["nodes"], found.get("edges", []), graph_log, graph_log
    if not (folder / NODES).is_file():
        what = f"neither {GRAPH} with nodes nor {NODES} is there"
        raise InputError(what, where=place(path), allowed=f"a folder with {GRAPH}, or {NODES} and {EDGES}")
    node_log, edge_log = log.beside(NODES), log.beside(EDGES)
    nodes = jsontext.sections(read_text(folder / NODES, node_log, folder), node_log).get("", [])
    if not (folder / EDGES).exists():
        edge_log.add(None, "the file is missing", "read without edges")
    return nodes, _document(folder / EDGES, edge_log, folder).get("edges", []), node_log, edge_log


def _document(path: Path, log: IssueLog, folder: Path) -> dict[str, list[Item]]:
    text = read_optional(path, log, folder)
    return jsontext.sections(text, log) if text else {}


def _row(item: Item, log: IssueLog) -> RawRow | None:
    node = item.value
    key = jsontext.repeated(node)
    if not isinstance(node, dict) or key:
        log.add(item.line, f"the node states {show(key)} twice" if key else "the node is no object", ROW_OUT)
        return None
    x, y, z = _numbers(node.get("position"), 3) or (None, None, None)
    return RawRow(
        line=item.line,
        id=_id(node.get("node_id")),
        x=x,
        y=y,
        z=z,
        yaw=_yaw(node.get("quaternion"), item.line, log),
        time=_time(node.get("timestamp"), item.line, log),
        image=node.get("image"),
        caption=_caption(node.get("caption"), item.line, log),
    )


def _id(value: object) -> object:
    """A whole number as text; anything else as it is, for the checks to judge."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**18 else value


def _numbers(value: object, n: int) -> list[object] | None:
    return value if isinstance(value, list) and len(value) == n else None


def _yaw(given: object, line: int, log: IssueLog) -> float | None:
    """Heading of the optical axis, R(q)·(0, 0, 1), in the x-y plane; None if there is none, which is reported.

    Order and axes were found by trying all: only (x, y, z, w) from camera to world puts the camera's x axis level in
    every frame, its y axis down, and its z axis level (10° up) and along the walk (cosine 0.98 in the median).
    """
    if given is None:
        return None
    q = [number(v) for v in _numbers(given, 4) or []]
    x, y, z, w = (math.nan if v is None else v for v in (q or [None] * 4))
    norm = math.sqrt(x * x + y * y + z * z + w * w) if max(map(abs, (x, y, z, w))) < 1e100 else math.nan
    if not math.isfinite(norm) or norm < 1e-9:
        log.add(line, f"the quaternion {_said(given)} is no rotation", "yaw unknown")
        return None
    ahead = (2 * (x * z + y * w), 2 * (y * z - x * w))  # times norm², which atan2 does not see
    if math.hypot(*ahead) < 1e-6 * norm * norm:
        log.add(line, f"the camera of quaternion {_said(given)} looks straight up or down", "yaw unknown")
        return None
    return math.atan2(ahead[1], ahead[0])


def _said(given: object) -> str:
    four = _numbers(given, 4)
    return f"[{', '.join(show(v, 20) for v in four)}]" if four else show(given)


def _time(given: object, line: int, log: IssueLog) -> Interval | None:
    if given is None:
        return None
    micros = number(given)
    if micros is None or not math.isfinite(micros):
        log.add(line, f"the time stamp is {show(given)}, not microseconds", "kept without time")
        return None
    return Interval(micros / 1e6, micros / 1e6)


def _caption(given: object, line: int, log: IssueLog) -> object:
    """`{"Description", "Objects"}` in a JSON string as "Description Objects: ..."; other text as it is, reported."""
    if not isinstance(given, str) or not given.strip():
        return given
    try:
        said = jsontext.loads(given)
    except ValueError as error:
        log.add(line, f"the caption is not JSON: {error}", "read as plain text")
        return given
    description = said.get("Description") if isinstance(said, dict) else None
    objects = _objects(said.get("Objects")) if isinstance(said, dict) else None
    if jsontext.repeated(said) or not isinstance(description, str) or objects is None:
        log.add(line, "the caption's JSON has no single Description and Objects", "read as plain text")
        return given
    sentence = description.strip()
    sentence += "" if sentence.endswith((".", "!", "?")) or not sentence else "."
    return f"{sentence}{_LIST}{objects.strip().rstrip('.')}." if objects.strip() else sentence


def said_and_listed(caption: str) -> tuple[str, tuple[str, ...]]:
    """A caption of this reader as it was made: the text, and the objects listed after it, each once."""
    text, mark, listed = caption.rpartition(_LIST)
    if not mark:
        return caption, ()
    return text, tuple(dict.fromkeys(filter(None, (o.strip(" .") for o in listed.split(",")))))


def _objects(value: object) -> str | None:
    if isinstance(value, list) and all(isinstance(v, str) for v in value):
        return ", ".join(value)
    return "" if value is None else value if isinstance(value, str) else None


def _edge(item: Item, log: IssueLog) -> RawEdge | None:
    edge = item.value
    key = jsontext.repeated(edge)
    if not isinstance(edge, dict) or key:
        log.add(item.line, f"the edge states {show(key)} twice" if key else "the edge is no object", EDGE_OUT)
        return None
    kind = edge.get("type")
    if not isinstance(kind, str) or kind not in _EDGE_KINDS:
        log.add(item.line, f"the type of the edge is {show(kind)}, none of {', '.join(_EDGE_KINDS)}", EDGE_OUT)
        return None
    return RawEdge(item.line, _id(edge.get("src")), _id(edge.get("dst")), _EDGE_KINDS[kind])


def _forest(folder: Path, images: Mapping[str, str | None], log: IssueLog) -> tuple[list[RawCluster], IssueLog]:
    """The clusters of the forest file, with leaves named by the node ids of the graph."""
    files = sorted(folder.glob(FOREST))
    if not files:
        return [], log
    for other in files[1:]:
        log.beside(other.name).add(None, f"a second forest beside {files[0].name}", "not read")
    forest_log = log.beside(files[0].name)
    nodes = _document(files[0], forest_log, folder).get("nodes", [])
    leaves = dict(_leaves(nodes, images, forest_log))
    return list(_clusters(nodes, leaves, forest_log)), forest_log


def _leaves(nodes: list[Item], images: Mapping[str, str | None], log: IssueLog) -> Iterator[tuple[str, str]]:
    """Leaf id -> node id: leaf `L0_7` is node 7; where both name an image, it must be the same one."""
    for item in nodes:
        leaf = item.value
        if not isinstance(leaf, dict) or item.key is None or leaf.get("type") != _LEAF:
            continue
        node = item.key.rpartition("_")[2]
        image = images.get(node)
        if node not in images or (image and leaf.get("image") not in (None, image)):
            log.add(item.line, f"the leaf {show(item.key)} is no node of the graph", "leaf left out of the forest")
        else:
            yield item.key, node


def _clusters(nodes: list[Item], leaves: Mapping[str, str], log: IssueLog) -> Iterator[RawCluster]:
    for item in nodes:
        value = item.value
        if isinstance(value, dict) and value.get("type") == _LEAF:
            continue
        children = value.get("children") if isinstance(value, dict) else None
        if not isinstance(value, dict) or not isinstance(children, list):
            log.add(item.line, f"{show(item.key)} is neither a leaf nor a cluster with children", CLUSTER_OUT)
            continue
        members = tuple(leaves.get(c, c) if isinstance(c, str) else c for c in children)
        yield RawCluster(item.line, item.key, value.get("level"), members, None, value.get("summary"))
