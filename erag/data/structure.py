"""The rules every given edge and cluster is checked by, whatever reader it came from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Set

from erag.core.text import MAX_CAPTION
from erag.core.types import EdgeKind
from erag.data.reading import GivenCluster, GivenEdge
from erag.data.rows import CLUSTER_OUT, EDGE_OUT, IssueLog, RawCluster, RawEdge, number, show
from erag.data.validation import MAX_METRES, MAX_NAME, problem_of_id, text_of

EDGE_KINDS: Mapping[str, EdgeKind] = {kind.name.lower(): kind for kind in EdgeKind}
MAX_LEVEL = 100


def edges(rows: Iterable[RawEdge], nodes: Set[str], log: IssueLog) -> tuple[GivenEdge, ...]:
    """The usable edges in the order of the source; each one left out is an issue whose action begins with EDGE_OUT.

    A length that is negative or not finite is left out and the edge kept, so that the map measures it.
    """
    kept: dict[tuple[str, str, EdgeKind], tuple[int, GivenEdge]] = {}
    for row in rows:
        if problem := _problem_of_edge(row, nodes):
            log.add(row.line, problem, EDGE_OUT)
            continue
        kind = EDGE_KINDS[str(row.kind)]
        made = GivenEdge(str(row.a), str(row.b), kind, _metres(row, log))
        key = (min(made.a, made.b), max(made.a, made.b), kind)
        if key in kept:
            line, first = kept[key]
            other = "" if made.metres == first.metres else f" with length {made.metres} instead of {first.metres}"
            log.add(row.line, f"the edge {_name(row)} of line {line} again{other}", f"{EDGE_OUT}, the first is kept")
            continue
        kept[key] = (row.line, made)
    return tuple(edge for _, edge in kept.values())


def _name(row: RawEdge) -> str:
    return f"{show(row.a)} - {show(row.b)}"


def _problem_of_edge(row: RawEdge, nodes: Set[str]) -> str | None:
    for end in (row.a, row.b):
        if not isinstance(end, str):
            return f"an end of the edge {_name(row)} is not an id"
        if end not in nodes:
            return f"the edge {_name(row)} ends at {show(end)}, which is no node or was left out"
    if row.a == row.b:
        return f"the edge {_name(row)} joins a node with itself"
    if not isinstance(row.kind, str) or row.kind not in EDGE_KINDS:
        return f"the edge {_name(row)} has the kind {show(row.kind)}, none of {', '.join(EDGE_KINDS)}"
    return None


def _metres(row: RawEdge, log: IssueLog) -> float | None:
    if row.metres is None:
        return None
    metres = number(row.metres)
    if metres is None or not math.isfinite(metres) or not 0 <= metres <= MAX_METRES:
        what = f"the length of the edge {_name(row)} is {show(row.metres)}, not metres from 0 to {MAX_METRES:.0e}"
        log.add(row.line, what, "length left out, the map measures it")
        return None
    return metres


def clusters(rows: Iterable[RawCluster], nodes: Set[str], log: IssueLog) -> tuple[GivenCluster, ...]:
    """The usable clusters in the order of the source; each one left out is an issue that begins with CLUSTER_OUT.

    Members must be nodes or clusters of a lower level and have one parent, so what is returned is a forest.
    """
    known = _with_ids(rows, nodes, log)
    tree = _Tree(nodes, known, log)
    for row in sorted(known.values(), key=_level):  # stable: children before parents
        tree.add(row)
    return tuple(_cluster(row, tree.members[i], log) for i, row in known.items() if i in tree.members)


class _Tree:
    """Members of the clusters accepted so far, each with one parent."""

    def __init__(self, nodes: Set[str], known: Mapping[str, RawCluster], log: IssueLog) -> None:
        self._nodes, self._known, self._log = nodes, known, log
        self._parent: dict[str, str] = {}
        self.members: dict[str, tuple[str, ...]] = {}

    def add(self, row: RawCluster) -> None:
        """Accept a cluster with those of its members that can be; report the others, or that none is left."""
        kept: list[str] = []
        for member in row.members:
            problem = self._problem(member, row)
            if problem is None:
                kept.append(str(member))
                self._parent[str(member)] = str(row.id)
            else:
                what = f"the member {show(member)} of the cluster {show(row.id)} {problem}"
                self._log.add(row.line, what, "member left out")
        if kept:
            self.members[str(row.id)] = tuple(kept)
        else:
            self._log.add(row.line, f"the cluster {show(row.id)} has no members", CLUSTER_OUT)

    def _problem(self, member: object, row: RawCluster) -> str | None:
        if not isinstance(member, str) or (member not in self._nodes and member not in self._known):
            return "is no node or cluster, or was left out"
        if member in self._known and _level(self._known[member]) >= _level(row):
            return f"is of level {_level(self._known[member])}, not below"
        if member in self._known and member not in self.members:
            return "was left out"
        return f"is already a member of {show(self._parent[member])}" if member in self._parent else None


def _level(row: RawCluster) -> int:
    return row.level if isinstance(row.level, int) else 0


def _with_ids(rows: Iterable[RawCluster], nodes: Set[str], log: IssueLog) -> dict[str, RawCluster]:
    """Clusters by id, those left out that have no usable id or level."""
    known: dict[str, RawCluster] = {}
    for row in rows:
        problem = problem_of_id(row.id)
        if not problem and (isinstance(row.level, bool) or not isinstance(row.level, int)):
            problem = f"the level of the cluster {show(row.id)} is {show(row.level)}, not a whole number"
        elif not problem and not 1 <= _level(row) <= MAX_LEVEL:
            problem = f"the level of the cluster {show(row.id)} is {show(row.level)}, not 1 to {MAX_LEVEL}"
        elif not problem and (row.id in nodes or row.id in known):
            taken = "a node" if row.id in nodes else f"the cluster of line {known[str(row.id)].line}"
            problem = f"the id {show(row.id)} of a cluster is also that of {taken}"
        if problem:
            log.add(row.line, problem, CLUSTER_OUT)
        else:
            known[str(row.id)] = row
    return known


def _cluster(row: RawCluster, members: tuple[str, ...], log: IssueLog) -> GivenCluster:
    name = text_of(row.name, "cluster's name", MAX_NAME, row.line, log)
    summary = text_of(row.summary, "cluster's summary", MAX_CAPTION, row.line, log)
    if row.summary is None:
        log.add(row.line, f"the cluster {show(row.id)} has no summary", "kept without summary")
    said = (text_of(r, "relationship", MAX_CAPTION, row.line, log) for r in row.relationships)
    relationships = tuple(r for r in said if r)
    return GivenCluster(str(row.id), _level(row), members, name or "", summary or "", relationships)
