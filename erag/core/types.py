"""The values that pass between the stages: frozen dataclasses of numpy arrays and plain values."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.int64]

Range = tuple[float, float]
SensorWish = Literal["low", "high"] | Range
QueryKind = Literal["find", "explain"]
NO_PARENT = -1


class Frame(enum.StrEnum):
    """The coordinate frame of a map. Positions are kept as the source gave them."""

    WGS84 = "wgs84"  # x = longitude °, y = latitude °, z = metres
    METRIC = "metric"  # metres, right-handed; yaw in radians from +x towards +y


class EdgeKind(enum.IntEnum):
    """Why two nodes are joined. `OBSERVED_FROM` ties an object to a pose and is not traversable."""

    PATH = 0
    RADIUS = 1
    BRIDGE = 2
    OBSERVED_FROM = 3


@dataclass(frozen=True, slots=True)
class Pose:
    """A position in the map's `Frame`, and the heading `yaw` in radians (None = unknown)."""

    x: float
    y: float
    z: float = 0.0
    yaw: float | None = None

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.x, self.y, self.z, self.yaw or 0.0)):
            raise ValueError(f"a pose must be finite, got {self.xyz} yaw {self.yaw}")

    @property
    def xyz(self) -> tuple[float, float, float]:
        return (self.x, self.y, self.z)


@dataclass(frozen=True, slots=True)
class Interval:
    """UTC seconds since 1970, end exclusive. An instant is an interval of length 0."""

    start: float
    end: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.start <= self.end):
            raise ValueError(f"an interval needs finite start <= end, got [{self.start}, {self.end})")

    def overlaps(self, since: float | None, until: float | None) -> bool:
        """Whether any moment of this interval lies in [since, until)."""
        after = since is None or self.end > since or self.start >= since
        return after and (until is None or self.start < until)


@dataclass(frozen=True, slots=True)
class Observation:
    """One experience `E_t = (time, sensors, pose)` of the paper: what a robot saw at a pose.

    `id` is the source's own id; `image` a POSIX path relative to the source's folder; `sensors` maps a channel
    (for example `ndvi`) to its reading; `source` names where it came from. `objects` are what a captioner was sure to
    see in the image, when a build captioned it.
    """

    id: str
    kind: Literal["place", "object"]
    pose: Pose
    time: Interval | None = None
    image: str | None = None
    name: str | None = None
    caption: str | None = None
    sensors: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    objects: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Undirected edges: `index` (2, e) int64 node rows, `kind` (e,) int8 of `EdgeKind`, `metres` (e,) float64."""

    index: IntArray
    kind: npt.NDArray[np.int8]
    metres: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return int(self.kind.shape[0])

    @classmethod
    def empty(cls) -> Edges:
        return cls(np.empty((2, 0), np.int64), np.empty(0, np.int8), np.empty(0, np.float64))

    @property
    def traversable(self) -> npt.NDArray[np.bool_]:
        """(e,) bool: all edges a robot may drive, that is all but `OBSERVED_FROM`."""
        return np.not_equal(self.kind, EdgeKind.OBSERVED_FROM)


@dataclass(frozen=True, eq=False)
class TopoMap:
    """The topological map: nodes in a fixed order and the edges between their rows (paper, section on memory)."""

    frame: Frame
    nodes: tuple[Observation, ...]
    edges: Edges

    def __len__(self) -> int:
        return len(self.nodes)

    @cached_property
    def positions(self) -> npt.NDArray[np.float64]:
        """(n, 3) positions in `frame`."""
        return np.array([n.pose.xyz for n in self.nodes], np.float64).reshape(-1, 3)

    @cached_property
    def row(self) -> Mapping[str, int]:
        """Node id -> row."""
        return {n.id: i for i, n in enumerate(self.nodes)}


@dataclass(frozen=True, slots=True)
class Cluster:
    """An inner node of the semantic forest. `members` are ids of nodes or clusters; `mean_distance` is in metres."""

    id: str
    level: int
    members: tuple[str, ...]
    position: tuple[float, float, float]
    mean_distance: float
    name: str = ""
    summary: str = ""
    relationships: tuple[str, ...] = ()
    sensors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Forest:
    """The semantic forest over m = n + c rows: first the map's n nodes (leaves), then c clusters.

    `parent` (m,) int64, -1 marks a root; `level` (m,) int64, leaves 0; `embeddings` (m, d) float32 unit rows, a row of
    zeros where there is nothing to embed. A row may skip a level: what joins no cluster at one level is carried to the
    next as it is.
    """

    leaves: tuple[str, ...]
    clusters: tuple[Cluster, ...]
    parent: IntArray
    level: IntArray
    embeddings: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        m = len(self.leaves) + len(self.clusters)
        if self.parent.shape != (m,) or self.level.shape != (m,) or len(self.embeddings) != m:
            raise ValueError(f"a forest of {m} rows got arrays {self.parent.shape} {self.level.shape}")
        below = self.parent != NO_PARENT
        above = self.parent[below]
        if (above < 0).any() or (above >= m).any() or (self.level[above] <= self.level[below]).any():
            raise ValueError("a forest needs parents among its rows, each on a level above its children's")

    @property
    def n_leaves(self) -> int:
        return len(self.leaves)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Ids of all m rows: node ids, then cluster ids."""
        return self.leaves + tuple(c.id for c in self.clusters)

    @cached_property
    def children(self) -> tuple[IntArray, ...]:
        """For each of the m rows the rows below it, ascending (empty for leaves)."""
        order = np.argsort(self.parent, kind="stable")
        bounds = np.searchsorted(self.parent[order], np.arange(len(self.parent) + 1))
        return tuple(order[bounds[i] : bounds[i + 1]] for i in range(len(self.parent)))

    @cached_property
    def roots(self) -> IntArray:
        return np.flatnonzero(self.parent == NO_PARENT)

    def path(self, row: int) -> tuple[str, ...]:
        """Ids from the root down to `row`, itself last."""
        up = [row]
        while self.parent[up[-1]] != NO_PARENT:
            up.append(int(self.parent[up[-1]]))
        return tuple(self.ids[i] for i in reversed(up))


@dataclass(frozen=True, slots=True)
class Query:
    """What is asked: Q (`text`), L (`at`), S (`sensors`), a time window, how many hits. One of Q and L is needed.

    `hours` [from, to) are hours of the day in UTC, over midnight where from > to; `now` is the moment to which words
    such as `yesterday` are relative (None: the memory's newest observation).
    """

    text: str | None = None
    at: Pose | None = None
    sensors: Mapping[str, SensorWish] = field(default_factory=dict)
    since: float | None = None
    until: float | None = None
    top: int = 5
    kind: QueryKind | None = None
    id: str = ""
    hours: Range | None = None
    now: float | None = None


@dataclass(frozen=True, slots=True)
class Hit:
    """A base node found: scores lie in [0, 1], or are None where that part was not asked or has no reading."""

    node: str
    position: tuple[float, float, float]
    score: float
    semantic: float | None = None
    spatial: float | None = None
    sensor: float | None = None
    path: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where to go: a node of the map and its pose."""

    node: str
    frame: Frame
    position: tuple[float, float, float]
    yaw: float | None = None


@dataclass(frozen=True, slots=True)
class Route:
    """The shortest way over traversable edges. `bridges` counts the edges on it that only the bridge rule made."""

    status: Literal["ok", "no_start", "unreachable", "off_map"]
    nodes: tuple[str, ...] = ()
    length_m: float | None = None
    bridges: int = 0


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a query: text and its reason, where to go, how, and the node ids it rests on."""

    kind: QueryKind
    text: str
    reason: str = ""
    waypoint: Waypoint | None = None
    route: Route | None = None
    evidence: tuple[str, ...] = ()
