"""Time and peak memory of clustering at several sizes, each measured in a process of its own."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from erag.bench.memory import peak_mb
from erag.core.geometry import EARTH_RADIUS_M, Points, pairwise
from erag.core.types import Edges, Frame, IntArray, Observation, Pose, TopoMap
from erag.forest.affinity import affinity, auto_theta, unit_rows
from erag.forest.build import build_forest
from erag.forest.config import ForestConfig, ShrinkCuts
from erag.forest.linkage import Goal, Limits, complete_linkage

Vectors = npt.NDArray[np.float32]
Method = Literal["full matrix", "passes", "forest"]
FULL_MATRIX_ROWS = 6000  # above it the reference is not run: it needs about 70 bytes a pair of rows

# The generated map: WORLD places along streets of a square, copied on a grid.
WORLD, WORLD_SIDE_M, STREET, STEP_M = 3_000, 1_000.0, 100, 10.0
DIMENSIONS, TOPICS, TOPIC_PLACES = 384, 60, 25
COMMON = (0.35, 0.85)  # cosine of any two places: a topic's share of what all places have in common
TOPIC, COPY = 0.6, 0.8  # share of the rest that is the topic's; cosine of a place and its copy
COPY_SHIFT_M, COPY_JITTER_M = 1_200.0, 2.0
ORIGIN = (8.0, 47.0)  # longitude, latitude


@dataclass(frozen=True)
class Row:
    """One measurement: `seconds` and `cpu_seconds` of the work, `peak_mb` of the whole process, what came out.

    `groups` remain at the cut of level 1 (clusters of the whole forest for the method `forest`); `digest` is a hash of
    the partition. `same` says whether it is the partition of scipy's full matrix, None where that was not run.
    """

    nodes: int
    method: Method
    seconds: float
    cpu_seconds: float
    peak_mb: float
    groups: int
    note: str
    digest: str
    same: bool | None = None


def run(sizes: Sequence[int], seed: int) -> Iterator[Row]:
    """Measure each size: level 1 by scipy's full matrix where it fits, level 1 in passes, and the whole forest.

    Every measurement is a fresh process, so that its peak memory is its own.
    """
    for nodes in sizes:
        reference: Row | None = None
        if nodes <= FULL_MATRIX_ROWS:
            reference = _apart(full_matrix, nodes, seed)
            yield reference
        row = _apart(passes, nodes, seed)
        yield replace(row, same=None if reference is None else row.digest == reference.digest)
        yield _apart(forest, nodes, seed)


def columns(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The measurements as a table: names of columns, and cells."""
    names = ("nodes", "method", "seconds", "cpu s", "peak MB", "groups", "as scipy", "what")
    same = {True: "yes", False: "NO", None: "–"}
    cells: list[tuple[str, ...]] = [
        (
            f"{r.nodes:,}",
            r.method,
            f"{r.seconds:.1f}",
            f"{r.cpu_seconds:.1f}",
            f"{r.peak_mb:,.0f}",
            f"{r.groups:,}",
            same[r.same],
            r.note,
        )
        for r in rows
    ]
    return names, cells


def full_matrix(nodes: int, seed: int) -> Row:
    """Level 1 by scipy alone: the whole matrix of 1 − S, complete linkage, the wanted number of groups."""
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    positions, vectors = perturbed_copies(nodes, seed)
    config, theta, wanted = _level_one(positions)
    clock = _Clock()
    units = unit_rows(vectors)
    spatial = np.exp(-pairwise(Frame.WGS84, positions, positions) / theta)
    far = 1.0 - (1.0 - config.alpha) * spatial - config.alpha * (units @ units.T)
    np.fill_diagonal(far, 0.0)
    tree = linkage(squareform(np.maximum(far, 0.0), checks=False), "complete")
    return clock.row(nodes, "full matrix", fcluster(tree, wanted, "maxclust"), "scipy, level 1")


def passes(nodes: int, seed: int) -> Row:
    """Level 1 by passes over close pairs, whatever the size."""
    positions, vectors = perturbed_copies(nodes, seed)
    config, theta, wanted = _level_one(positions)
    clock = _Clock()
    rows = affinity(Frame.WGS84, positions, vectors, config.alpha, theta)
    made = complete_linkage(rows, Goal(rows=wanted), Limits(2, config.edge_limit, config.max_passes))
    cut = made.tree.height[made.merges - 1]
    note = f"level 1, cut {cut:.3f}, {made.edges:,} pairs in {made.passes} passes"
    return clock.row(nodes, "passes", made.tree.labels(made.merges), note)


def forest(nodes: int, seed: int) -> Row:
    """The whole forest with the default configuration."""
    positions, vectors = perturbed_copies(nodes, seed)
    places = tuple(Observation(str(i), "place", Pose(*map(float, p))) for i, p in enumerate(positions))
    topomap = TopoMap(Frame.WGS84, places, Edges.empty())
    clock = _Clock()
    grown, report = build_forest(topomap, vectors)
    note = "nodes per level " + " · ".join(f"{n:,}" for n in np.bincount(grown.level))
    return replace(clock.row(nodes, "forest", grown.parent, note), groups=sum(r.clusters for r in report.levels))


def perturbed_copies(nodes: int, seed: int) -> tuple[Points, Vectors]:
    """A map of `nodes` places: longitude, latitude, height (n, 3) and unit vectors (n, 384).

    A generated world of 3,000 places, and copies of it: moved to a square of their own, each place moved a little, each
    vector mixed with noise so that it has cosine 0.8 to its copy.
    """
    rng = np.random.default_rng(seed)
    metres, vectors = _world(rng)
    copies = -(-nodes // WORLD)
    side = int(np.ceil(np.sqrt(copies)))
    places, words = [], []
    for copy in range(copies):
        shift = COPY_SHIFT_M * np.array(divmod(copy, side))
        places.append(metres + shift + rng.normal(scale=COPY_JITTER_M, size=metres.shape))
        words.append(_mixed(vectors, _directions(rng, WORLD), COPY).astype(np.float32))
    return _wgs84(np.concatenate(places)[:nodes]), np.concatenate(words)[:nodes]


def _world(rng: np.random.Generator) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Places (WORLD, 2) in metres along straight streets, and vectors (WORLD, d) whose topic changes on the way."""
    streets = WORLD // STREET
    start = rng.uniform(0, WORLD_SIDE_M, (streets, 1, 2))
    angle = rng.uniform(0, 2 * np.pi, (streets, 1))
    along = np.arange(STREET)[None, :] * STEP_M
    course = np.stack([np.cos(angle) * along, np.sin(angle) * along], axis=2)
    metres = np.abs((start + course).reshape(-1, 2) % (2 * WORLD_SIDE_M) - WORLD_SIDE_M)  # reflected at the border
    topic = np.repeat(rng.integers(0, TOPICS, WORLD // TOPIC_PLACES), TOPIC_PLACES)
    own = _mixed(_directions(rng, TOPICS)[topic], _directions(rng, WORLD), TOPIC)
    common = rng.uniform(*COMMON, (TOPICS, 1))[topic]  # (WORLD, 1)
    return metres, _mixed(np.broadcast_to(_directions(rng, 1), own.shape), own, common)


def _directions(rng: np.random.Generator, n: int) -> npt.NDArray[np.float64]:
    return unit_rows(rng.normal(size=(n, DIMENSIONS)))


def _mixed(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], share: float | npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Unit rows that have `share` of their squared length from a and the rest from b."""
    return unit_rows(np.sqrt(share) * a + np.sqrt(1 - share) * b)


def _wgs84(metres: npt.NDArray[np.float64]) -> Points:
    lat = ORIGIN[1] + np.degrees(metres[:, 1] / EARTH_RADIUS_M)
    lon = ORIGIN[0] + np.degrees(metres[:, 0] / EARTH_RADIUS_M) / np.cos(np.radians(lat))
    return np.stack([lon, lat, np.zeros(len(metres))], axis=1)


def _level_one(positions: Points) -> tuple[ForestConfig, float, int]:
    """The default configuration, its θ on this map and how many rows level 1 is to have."""
    cuts = ShrinkCuts()
    wanted = max(1, round(len(positions) / cuts.first))
    return ForestConfig(cuts=cuts), auto_theta(Frame.WGS84, positions, cuts.first), wanted


class _Clock:
    """Measures from its making to `row`."""

    def __init__(self) -> None:
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def row(self, nodes: int, method: Method, label: IntArray, note: str) -> Row:
        wall, cpu = time.perf_counter() - self.wall, time.process_time() - self.cpu
        return Row(nodes, method, wall, cpu, peak_mb(), len(np.unique(label)), note, _digest(label))


def _digest(label: IntArray) -> str:
    """A hash of a partition that does not depend on how its groups are numbered."""
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    return hashlib.sha256(first[group].astype("<i8").tobytes()).hexdigest()


def _apart(work: Callable[[int, int], Row], nodes: int, seed: int) -> Row:
    """`work` in a fresh process."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(work, nodes, seed).result()
