"""A small park that was driven through twice, for tests of times, changes and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from erag.core.times import parse_time
from erag.core.types import Edges, Frame, Interval, Observation, Pose, TopoMap

FIRST, SECOND = "2025-04-12T09:00:00Z", "2025-10-25T16:30:00Z"


def seconds(stamp: str) -> float:
    return parse_time(stamp).start


def view(
    node: str,
    x: float,
    stamp: str,
    caption: str,
    step: int = 0,
    yaw: float | None = 0.0,
    y: float = 0.0,
    **sensors: float,
) -> Observation:
    at = seconds(stamp) + 10 * step
    return Observation(
        node, "place", Pose(x, y, 0.0, yaw), Interval(at, at), caption=caption, sensors=sensors, source="twice"
    )


def thing(node: str, name: str, x: float, stamp: str, y: float = 0.0) -> Observation:
    at = seconds(stamp)
    return Observation(node, "object", Pose(x, y), Interval(at, at), name=name)


def map_of(nodes: Sequence[Observation]) -> TopoMap:
    return TopoMap(Frame.METRIC, tuple(nodes), Edges.empty())


def drive(letter: str, stamp: str, captions: Mapping[int, str], usual: str, count: int = 8) -> list[Observation]:
    """A drive east along a line, a view every two metres looking ahead; `captions` replace the `usual` one."""
    return [view(f"{letter}{i}", 2.0 * i, stamp, captions.get(i, usual), i) for i in range(count)]


def twice() -> TopoMap:
    """A tent stands ahead on the first visit and is gone on the second, when there is a ladder; a bench stays."""
    usual = "A wooden bench stands in the centre of the view."
    tent = "A wooden bench stands in the centre of the view. There is also an orange tent."
    ladder = "A wooden bench stands in the centre of the view. There is also a metal ladder."
    first = drive("a", FIRST, dict.fromkeys((2, 3, 4), tent), usual)
    second = drive("b", SECOND, {**dict.fromkeys((2, 3, 4), ladder), 7: "An empty path."}, usual)
    return map_of([*first, *second])
