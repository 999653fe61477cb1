"""Query lines: their shape in `queries.jsonl`, and what every family of queries needs of a world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from erag.core.times import parse_time
from erag.sim.layout import World
from erag.sim.truth import View

Kind = Literal["explicit", "implicit", "global"]
Task = Literal["find", "describe", "count", "change", "unanswerable", "last_seen"]
SPEED = 0.6  # metres per second of the robot
Line = dict[str, Any]
Wish = Literal["low", "high"]


@dataclass(frozen=True)
class Known:
    """What is known of a world: its visits, the views of all nodes, and where each class is visible."""

    visits: Sequence[World]
    views: Sequence[View]
    objects: bool  # whether object nodes are in the data set, and so among the relevant nodes

    @property
    def name(self) -> str:
        """The name of the world, the environment of its queries."""
        return self.visits[0].name

    @cached_property
    def nodes_by_class(self) -> Mapping[str, tuple[str, ...]]:
        """Class -> nodes at which one of it covers at least `VISIBLE` of the image; then the nodes of the objects."""
        found: dict[str, dict[str, None]] = {}
        for v in self.views:
            for o in v.visible:
                found.setdefault(o.name, {})[v.node] = None
        if self.objects:
            for v in self.views:
                for o in v.visible:
                    found[o.name][f"{o.instance}@{'ab'[v.visit - 1]}"] = None
        return {name: tuple(nodes) for name, nodes in sorted(found.items())}

    @cached_property
    def instances(self) -> Mapping[str, frozenset[str]]:
        """Class -> instances that were visible on the first visit."""
        found: dict[str, set[str]] = {}
        for v in self.views:
            for o in v.visible if v.visit == 1 else ():
                found.setdefault(o.name, set()).add(o.instance)
        return {name: frozenset(ids) for name, ids in sorted(found.items())}

    def nodes(self, *names: str) -> list[str]:
        """The nodes at which one of the classes is visible."""
        return list(dict.fromkeys(n for name in names for n in self.nodes_by_class.get(name, ())))

    def with_ndvi(self, nodes: Sequence[str], wish: Wish) -> list[str]:
        """Those place nodes whose NDVI is in the lower or upper third of the world's readings."""
        readings = {v.node: v.ndvi for v in self.views}
        low, high = np.quantile(list(readings.values()), (1 / 3, 2 / 3))
        inside = {n for n, r in readings.items() if (r <= low if wish == "low" else r >= high)}
        return [n for n in nodes if n in inside]

    def place(self, rng: np.random.Generator) -> list[float]:
        """The position of a node of the path, drawn at random: where a query is asked."""
        stops = self.visits[0].stops
        camera = stops[int(rng.integers(len(stops)))].camera
        return [round(camera.x, 2), round(camera.y, 2), camera.z]


def moment(world: World, index: int) -> float:
    """UTC seconds at which the robot is at a stop."""
    return round(parse_time(world.when.start).start + world.stops[index].metres / SPEED)


def query(known: Known, kind: Kind, task: Task, text: str, **more: Any) -> Line:
    """A line without its id; `more` are `relevant`, `golden_answer`, `at`, `sensor`, `since`, `until`,
    `target`, `seen_at`."""
    head: Line = {"id": "", "kind": kind, "task": task, "query": text}
    tail = {"environment": known.name, "split": known.visits[0].scene.split}
    return head | {key: value for key, value in more.items() if value is not None} | tail
