"""Questions and answers as the page words them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from erag.core.text import clean
from erag.core.times import format_time
from erag.core.types import Answer, Forest, Hit, Interval, Query, Route, SensorWish, TopoMap, Waypoint
from erag.generate.answer import NOTHING
from erag.report.asking import Asked
from erag.report.tree import title_of

Status = Literal["find", "explain", "refused", "error"]


@dataclass(frozen=True, slots=True)
class HitView:
    """A hit: scores are in [0, 1], `parts` those that were asked for; `clusters` the names of those it was
    found through."""

    row: int
    id: str
    title: str
    score: float
    parts: tuple[tuple[str, float], ...]
    clusters: tuple[str, ...]

    @property
    def way(self) -> str:
        """All clusters it was found through, from the root down."""
        return " › ".join(self.clusters)

    @property
    def near(self) -> str:
        """The lowest of them."""
        return self.clusters[-1] if self.clusters else ""


@dataclass(frozen=True, slots=True)
class QuestionView:
    """A question, the status of its answer, and the rows of what the map shows of it."""

    id: str
    text: str
    status: Status
    conditions: tuple[str, ...]
    answer: str
    reason: str
    waypoint: str
    route: str
    hits: tuple[HitView, ...]
    evidence: tuple[tuple[int, str], ...]
    notes: tuple[str, ...]
    cost: str
    start: tuple[float, float, float] | None
    goal: int | None
    way: tuple[int, ...]

    @property
    def preview(self) -> str:
        """The first line of the answer."""
        return self.answer.partition("\n")[0]


class Wording:
    """Words the questions asked of one map and forest."""

    def __init__(self, topomap: TopoMap, forest: Forest, *, seconds: bool = True) -> None:
        self._map, self._seconds = topomap, seconds
        self._titles = {cluster.id: title_of(cluster) for cluster in forest.clusters}

    def view(self, asked: Asked) -> QuestionView:
        """One question with its answer. Raises KeyError for a result that names nodes of another map."""
        result, answer, query = asked.result, asked.result.answer, asked.query
        waypoint = answer.waypoint if answer is not None else None
        return QuestionView(
            id=clean(result.id),
            text=clean(asked.text),
            status=status_of(asked),
            conditions=tuple(_conditions(query)) if query is not None else (),
            answer=_lines(result.error or (answer.text if answer is not None else "")),
            reason=clean(answer.reason) if answer is not None else "",
            waypoint=_waypoint(waypoint) if waypoint is not None else "",
            route=_route(answer.route) if answer is not None else "",
            hits=tuple(self._hit(hit) for hit in result.hits),
            evidence=self._evidence(answer),
            notes=tuple(map(clean, result.notes)),
            cost=self._cost(asked),
            start=query.at.xyz if query is not None and query.at is not None else None,
            goal=self._map.row[waypoint.node] if waypoint is not None else None,
            way=tuple(self._map.row[i] for i in answer.route.nodes) if answer is not None and answer.route else (),
        )

    def _hit(self, hit: Hit) -> HitView:
        row = self._map.row[hit.node]
        parts = (("semantic", hit.semantic), ("spatial", hit.spatial), ("sensor", hit.sensor))
        clusters = tuple(self._titles[i] for i in hit.path if i in self._titles)
        asked = tuple((name, value) for name, value in parts if value is not None)
        return HitView(row, clean(hit.node), self._title(row), hit.score, asked, clusters)

    def _title(self, row: int) -> str:
        node = self._map.nodes[row]
        return clean(node.name or "") if node.name != node.id else ""

    def _evidence(self, answer: Answer | None) -> tuple[tuple[int, str], ...]:
        if answer is None or answer.waypoint is not None:
            return ()
        return tuple((self._map.row[i], clean(i)) for i in answer.evidence)

    def _cost(self, asked: Asked) -> str:
        result = asked.result
        calls = (f"{n} {role}" for role, n in sorted(result.calls.items()) if n)
        facts = [f"{result.seconds:.3f} s"] if self._seconds and result.error is None else []
        facts += [f"{result.visited:,} rows scored"] if result.error is None else []
        return " · ".join([*facts, *([f"calls: {told}"] if (told := ", ".join(calls)) else [])])


def status_of(asked: Asked) -> Status:
    """`error` for what could not be asked, `refused` for what the memory does not know, else the kind of answer."""
    answer = asked.result.answer
    if asked.result.error is not None or answer is None:
        return "error"
    return "refused" if answer.text == NOTHING else answer.kind


def _conditions(query: Query) -> list[str]:
    """What a question asks beside its text."""
    found = [f"from {_place(query.at.xyz)}"] if query.at is not None else []
    found += [f"{clean(name)} {_wish(wish)}" for name, wish in _sorted(query.sensors)]
    found += [f"since {_moment(query.since)}"] if query.since is not None else []
    return found + ([f"until {_moment(query.until)}"] if query.until is not None else [])


def _sorted(sensors: Mapping[str, SensorWish]) -> list[tuple[str, SensorWish]]:
    return sorted(sensors.items(), key=lambda item: item[0])


def _wish(wish: SensorWish) -> str:
    return wish if isinstance(wish, str) else f"{wish[0]:g} to {wish[1]:g}"


def _moment(seconds: float) -> str:
    return format_time(Interval(seconds, seconds))


def _waypoint(waypoint: Waypoint) -> str:
    yaw = "" if waypoint.yaw is None else f", yaw {waypoint.yaw:.2f} rad"
    return f"{clean(waypoint.node)} at {_place(waypoint.position)} ({waypoint.frame.value}){yaw}"


def _route(route: Route | None) -> str:
    """How far it is, or why there is no route; empty where no start was given."""
    if route is None or route.status == "no_start":
        return ""
    if route.status != "ok" or route.length_m is None:
        return {"unreachable": "no way there is on the map", "off_map": "the start is off the map"}.get(
            route.status, ""
        )
    bridges = f", {route.bridges} of its edges bridged, not driven" if route.bridges else ""
    return f"{route.length_m:,.0f} m over {len(route.nodes):,} nodes{bridges}"


def _place(xyz: tuple[float, float, float]) -> str:
    return ", ".join(f"{v:.7g}" if abs(v) >= 1000 else f"{round(v, 6):g}" for v in xyz)


def _lines(text: str) -> str:
    """An answer's lines, each cleaned."""
    return "\n".join(filter(None, map(clean, text.split("\n"))))
