"""A forest that the source states: its clusters checked, its levels, positions and vectors computed as for our own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from erag.core.errors import InputError
from erag.core.types import NO_PARENT, Cluster, FloatArray, Forest, IntArray, TopoMap
from erag.data.reading import GivenCluster, Issue
from erag.forest.affinity import unit_rows
from erag.forest.clusters import Base, describe


@dataclass
class _Family:
    """Who is whose member: `members` of every usable cluster and the `parent` of what has one."""

    issues: list[Issue] = field(default_factory=list)
    members: dict[str, list[str]] = field(default_factory=dict)
    parent: dict[str, str] = field(default_factory=dict)

    def report(self, cluster: str, what: str, action: str) -> None:
        self.issues.append(Issue(f"cluster {cluster}", what, action))

    def ancestors(self, row: str) -> Iterator[str]:
        """`row` and all above it."""
        at: str | None = row
        while at is not None:
            yield at
            at = self.parent.get(at)


def given_forest(
    topomap: TopoMap, clusters: Sequence[GivenCluster], vectors: FloatArray
) -> tuple[Forest, tuple[Issue, ...]]:
    """The forest of `clusters` over a map whose nodes have unit `vectors` (n, d), zeros where there is no text.

    A member claimed twice stays with the cluster that comes first; unknown members, repeated ids, cycles and clusters
    left without members are dropped; every one of these is an issue. Levels are counted anew from the leaves, clusters
    ordered by level and then as given; names, summaries and relationships are kept. Nodes in no cluster are roots.
    Raises InputError when the vectors do not fit the map.
    """
    units = unit_rows(vectors).astype(np.float32)
    if len(units) != len(topomap):
        raise InputError(f"{len(units)} vectors for {len(topomap)} nodes", where="forest", allowed="one vector a node")
    family = _family(topomap, clusters)
    _drop_empty(family)
    levels = _levels(family)
    kept = sorted((c for c in _first_of_each(clusters) if c.id in levels), key=lambda c: levels[c.id])
    return _forest(Base(topomap, units), family, kept, levels), tuple(family.issues)


def _first_of_each(clusters: Sequence[GivenCluster]) -> list[GivenCluster]:
    return list({c.id: c for c in reversed(clusters)}.values())[::-1]


def _family(topomap: TopoMap, clusters: Sequence[GivenCluster]) -> _Family:
    """Members and parents, as far as they are consistent."""
    family = _Family()
    known: set[str] = set()
    usable: list[GivenCluster] = []
    for cluster in clusters:
        if cluster.id in topomap.row or cluster.id in known:
            taken = "a node" if cluster.id in topomap.row else "an earlier cluster"
            family.report(cluster.id, f"has the id of {taken}", "dropped")
        else:
            known.add(cluster.id)
            usable.append(cluster)
    for cluster in usable:
        family.members[cluster.id] = []
        for member in cluster.members:
            _claim(family, cluster.id, member, member in topomap.row or member in known)
    return family


def _claim(family: _Family, cluster: str, member: str, known: bool) -> None:
    """Make `member` a member of `cluster`, or say why not."""
    if not known:
        family.report(cluster, f"member {member!r} is neither a node nor a cluster", "member dropped")
    elif member in family.parent:
        family.report(cluster, f"member {member!r} belongs to cluster {family.parent[member]} already", "first kept")
    elif member in family.ancestors(cluster):
        family.report(cluster, f"member {member!r} contains this cluster", "member dropped")
    else:
        family.members[cluster].append(member)
        family.parent[member] = cluster


def _drop_empty(family: _Family) -> None:
    """Drop clusters without members, then those whose last member was dropped."""
    empty = [c for c, members in family.members.items() if not members]
    while empty:
        cluster = empty.pop()
        family.report(cluster, "has no members", "dropped")
        del family.members[cluster]
        above = family.parent.pop(cluster, None)
        if above is not None:
            family.members[above].remove(cluster)
            if not family.members[above]:
                empty.append(above)


def _levels(family: _Family) -> dict[str, int]:
    """Level of each cluster: one above its highest member; nodes are level 0."""
    level: dict[str, int] = {}
    waiting = {c: sum(m in family.members for m in members) for c, members in family.members.items()}
    ready = [c for c, count in waiting.items() if count == 0]
    while ready:
        cluster = ready.pop()
        level[cluster] = 1 + max(level.get(m, 0) for m in family.members[cluster])
        above = family.parent.get(cluster)
        if above is not None:
            waiting[above] -= 1
            if waiting[above] == 0:
                ready.append(above)
    return level


def _forest(base: Base, family: _Family, kept: list[GivenCluster], level: Mapping[str, int]) -> Forest:
    n, nodes = len(base.topomap), base.topomap.nodes
    row = dict(base.topomap.row) | {c.id: n + i for i, c in enumerate(kept)}
    parent = np.full(n + len(kept), NO_PARENT, np.int64)
    for member, cluster in family.parent.items():
        parent[row[member]] = row[cluster]
    leaves: list[IntArray] = [np.array([i]) for i in range(n)]
    places = [node.pose.xyz for node in nodes]
    made: list[Cluster] = []
    for given in kept:
        members = [row[m] for m in family.members[given.id]]
        below = np.sort(np.concatenate([leaves[m] for m in members]))
        at = np.array([places[m] for m in members], np.float64)
        plain = describe(base, given.id, level[given.id], family.members[given.id], below, at)
        leaves.append(below)
        places.append(plain.position)
        made.append(replace(plain, name=given.name, summary=given.summary, relationships=given.relationships))
    means = [base.mean_vector(below) for below in leaves[n:]]
    return Forest(
        leaves=tuple(node.id for node in nodes),
        clusters=tuple(made),
        parent=parent,
        level=np.array([0] * n + [c.level for c in made], np.int64),
        embeddings=np.concatenate([base.vectors, np.stack(means)]) if means else base.vectors,
    )
