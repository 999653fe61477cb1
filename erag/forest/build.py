"""A map to a semantic forest: level by level until one root is left or nothing meaningful merges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count

import numpy as np

from erag.core.errors import ConfigError, InputError
from erag.core.geometry import Points
from erag.core.progress import Progress, quiet
from erag.core.types import NO_PARENT, Cluster, FloatArray, Forest, Frame, IntArray, TopoMap
from erag.forest.affinity import affinity, auto_theta, unit_rows
from erag.forest.clusters import Base, Vectors, describe
from erag.forest.config import FixedCuts, ForestConfig, ShrinkCuts
from erag.forest.linkage import Goal, Limits, Linkage, complete_linkage
from erag.forest.report import ForestReport, LevelReport

SummaryVectors = Callable[[Sequence[Cluster]], Vectors]  # the new clusters of one level -> (k, d) float32


@dataclass(frozen=True)
class Rows:
    """What one level clusters, ordered by smallest base node: clusters of the levels below and what was carried.

    `row` (n,) their rows in the forest, `leaves` the base nodes below each, `positions` (n, 3), `vectors` (n, d).
    """

    row: IntArray
    leaves: tuple[IntArray, ...]
    positions: Points
    vectors: Vectors

    def __len__(self) -> int:
        return len(self.row)


@dataclass
class _Growing:
    """The forest so far: clusters and for every row its parent, id and vector."""

    base: Base
    ids: list[str]
    clusters: list[Cluster]
    parent: list[int]
    vectors: list[Vectors]

    def forest(self) -> Forest:
        n = len(self.base.topomap)
        return Forest(
            leaves=tuple(self.ids[:n]),
            clusters=tuple(self.clusters),
            parent=np.array(self.parent, np.int64),
            level=np.array([0] * n + [c.level for c in self.clusters], np.int64),
            embeddings=np.concatenate([self.base.vectors, *self.vectors]),
        )


def build_forest(
    topomap: TopoMap,
    vectors: FloatArray,
    config: ForestConfig | None = None,
    progress: Progress = quiet,
    summary_vectors: SummaryVectors | None = None,
) -> tuple[Forest, ForestReport]:
    """Cluster a map (paper, semantic forest): complete linkage on the hybrid similarity, level by level.

    `vectors` (n, d) are the nodes' unit vectors, rows of zeros for nodes without text. A group of fewer than `min_size`
    rows is no cluster: its rows are carried up as they are and may join later. `summary_vectors` is called once a level
    with its new clusters when `cluster_embedding` is `summary`. Names and summaries are left empty.
    Raises InputError for vectors that do not fit the map, ConfigError for settings that cannot be met.
    """
    config = config or ForestConfig()
    if (config.cluster_embedding == "summary") != (summary_vectors is not None):
        raise ConfigError(
            f"cluster_embedding is {config.cluster_embedding!r} {'with' if summary_vectors else 'without'} summaries",
            where="forest.cluster_embedding",
            allowed="'summary' with something that summarises, else 'mean'",
        )
    base = _base(topomap, vectors)
    grown = _Growing(base, [node.id for node in topomap.nodes], [], [NO_PARENT] * len(topomap), [])
    levels = _grow(grown, config, progress, summary_vectors)
    forest = grown.forest()
    return forest, ForestReport(config.alpha, config.theta == "auto", len(topomap), tuple(levels), len(forest.roots))


def _base(topomap: TopoMap, vectors: FloatArray) -> Base:
    units = unit_rows(vectors).astype(np.float32)
    if len(units) != len(topomap):
        raise InputError(f"{len(units)} vectors for {len(topomap)} nodes", where="forest", allowed="one vector a node")
    return Base(topomap, units)


def _theta(config: ForestConfig, frame: Frame, positions: Points, level: int) -> float:
    """θ in metres for rows (n, 3) that `level` clusters."""
    if config.theta != "auto":
        return config.theta
    cuts = config.cuts if isinstance(config.cuts, ShrinkCuts) else ShrinkCuts()
    return auto_theta(frame, positions, cuts.ratio(level))


def _grow(
    grown: _Growing, config: ForestConfig, progress: Progress, summaries: SummaryVectors | None
) -> list[LevelReport]:
    """Add level after level to `grown`."""
    n, frame = len(grown.base.topomap), grown.base.topomap.frame
    rows = Rows(np.arange(n), tuple(np.arange(n)[:, None]), grown.base.topomap.positions, grown.base.vectors)
    limits = Limits(config.dense_limit, config.edge_limit, config.max_passes)
    reports: list[LevelReport] = []
    for cut in count():
        level = len(reports) + 1
        goal = _goal(config, cut, len(rows))
        if goal is None or len(rows) < 2 or level > config.max_levels:
            break
        theta = _theta(config, frame, rows.positions, level)
        items = affinity(frame, rows.positions, rows.vectors, config.alpha, theta)
        made = complete_linkage(items, goal, limits, partial(progress, f"forest level {level}"))
        groups = made.tree.groups(made.merges, config.max_size)
        clusters = [g for g in groups if len(g) >= config.min_size]
        if clusters:
            reports.append(_level_report(level, theta, len(rows), clusters, made))
            rows = _next(grown, rows, level, clusters, summaries)
        elif isinstance(config.cuts, ShrinkCuts):
            break  # the next cut would be the same; a list of fixed cuts may go on
    return reports


def _goal(config: ForestConfig, cut: int, rows: int) -> Goal | None:
    """Where to make cut 0, 1, …; None when there is none."""
    cuts = config.cuts
    if isinstance(cuts, FixedCuts):
        return Goal(height=cuts.heights[cut]) if cut < len(cuts.heights) else None
    return Goal(height=1.0 - cuts.floor, rows=max(1, round(rows / cuts.ratio(cut + 1))))


def _level_report(level: int, theta: float, rows: int, clusters: list[IntArray], made: Linkage) -> LevelReport:
    sizes = tuple(len(c) for c in clusters)
    return LevelReport(
        level=level,
        theta=theta,
        rows=rows,
        sizes=sizes,
        carried=rows - sum(sizes),
        cut=float(made.tree.height[made.merges - 1]),
        path=made.path,
        pairs=made.edges,
        passes=made.passes,
        complete=made.complete,
    )


def _next(grown: _Growing, rows: Rows, level: int, groups: list[IntArray], summaries: SummaryVectors | None) -> Rows:
    """Add the clusters of one level, and return what the next one clusters."""
    base, first = grown.base, len(grown.ids)
    leaves = [np.sort(np.concatenate([rows.leaves[i] for i in group])) for group in groups]
    taken = set(grown.ids)
    new = [
        describe(
            base,
            ident=cluster_id(level, number, taken),
            level=level,
            members=[grown.ids[rows.row[i]] for i in group],
            leaves=below,
            places=rows.positions[group],
        )
        for number, (group, below) in enumerate(zip(groups, leaves, strict=True))
    ]
    vectors = _vectors(base, new, leaves, summaries)
    for number, group in enumerate(groups):
        for i in group:
            grown.parent[rows.row[i]] = first + number
    grown.ids += [c.id for c in new]
    grown.clusters += new
    grown.parent += [NO_PARENT] * len(new)
    grown.vectors.append(vectors)
    return _joined(
        rows,
        groups,
        Rows(np.arange(first, first + len(new)), tuple(leaves), np.array([c.position for c in new]), vectors),
    )


def _vectors(base: Base, new: list[Cluster], leaves: list[IntArray], summaries: SummaryVectors | None) -> Vectors:
    """(k, d) what stands for the new clusters when the next level is made."""
    if summaries is None:
        return np.stack([base.mean_vector(below) for below in leaves])
    given = unit_rows(summaries(new)).astype(np.float32)
    if given.shape != (len(new), base.vectors.shape[1]):
        raise InputError(f"summary vectors of shape {given.shape} for {len(new)} clusters", where="forest")
    return given


def _joined(rows: Rows, groups: list[IntArray], new: Rows) -> Rows:
    """The rows that joined no group, and the new ones, by smallest base node."""
    alone = np.ones(len(rows), bool)
    alone[np.concatenate(groups)] = False
    left = np.flatnonzero(alone)
    leaves = [*(rows.leaves[i] for i in left), *new.leaves]
    order = np.argsort([below[0] for below in leaves])
    return Rows(
        np.concatenate([rows.row[left], new.row])[order],
        tuple(leaves[i] for i in order),
        np.concatenate([rows.positions[left], new.positions])[order],
        np.concatenate([rows.vectors[left], new.vectors])[order],
    )


def cluster_id(level: int, number: int, taken: set[str]) -> str:
    """`L1-0`, with underscores before it where the map uses that id itself."""
    name = f"L{level}-{number}"
    while name in taken:
        name = f"_{name}"
    return name
