"""Time windows, sensor wishes and distances, each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.geometry import distance
from erag.core.types import Edges, Frame, Interval, Observation, Pose, TopoMap
from erag.retrieve.rank import Sensors, StraightLines, Times, auto_theta, blend, mean_known

MOMENTS = st.integers(0, 6).map(float)


def map_of(*nodes: Observation, frame: Frame = Frame.METRIC) -> TopoMap:
    return TopoMap(frame, nodes, Edges.empty())


def place(i: int, x: float = 0.0, y: float = 0.0, time: Interval | None = None, **sensors: float) -> Observation:
    return Observation(f"n{i}", "place", Pose(x, y), time=time, sensors=sensors)


@given(st.lists(st.tuples(MOMENTS, MOMENTS), max_size=8), st.none() | MOMENTS, st.none() | MOMENTS)
def test_a_window_keeps_what_overlaps_it(
    spans: list[tuple[float, float]], since: float | None, until: float | None
) -> None:
    known = [Interval(min(s), max(s)) for s in spans]
    times = Times.of(map_of(*(place(i, time=t) for i, t in enumerate([*known, None]))))
    assert times.within(since, until).tolist() == [*(t.overlaps(since, until) for t in known), False]
    assert times.known.tolist() == [True] * len(known) + [False]


def test_hours_of_the_day_run_over_midnight_and_leave_out_what_is_known_to_a_day() -> None:
    spans = [Interval(h * 3600.0, h * 3600.0) for h in (3, 9, 23)]
    times = Times.of(map_of(*(place(i, time=t) for i, t in enumerate([*spans, Interval(0.0, 86_400.0), None]))))
    assert times.within(None, None, (8, 12)).tolist() == [False, True, False, False, False]
    assert times.within(None, None, (22, 5)).tolist() == [True, False, True, False, False]
    assert times.within(4 * 3600.0, None, (22, 5)).tolist() == [False, False, True, False, False]


def test_low_and_high_are_the_outer_thirds_of_the_map_whatever_range_is_declared() -> None:
    nodes = [place(i, ndvi=v) for i, v in enumerate((0.1, 0.11, 0.12, 0.2, 0.3, 0.4))]
    for declared in ({"ndvi": (-1.0, 1.0)}, {}):
        sensors = Sensors(map_of(*nodes, place(6), place(7, ndvi=float("nan"))), declared)
        high = sensors.score("ndvi", "high", "q")
        assert high.tolist()[:6] == pytest.approx([0, 0, 0.25, 0.75, 1, 1])
        assert sensors.score("ndvi", "low", "q").tolist()[:6] == pytest.approx([1, 1, 0.75, 0.25, 0, 0])
        assert np.isnan(high[6:]).all()


def test_a_range_scores_one_inside_and_loses_with_distance_outside() -> None:
    sensors = Sensors(map_of(place(0, t=0.0), place(1, t=4.0), place(2, t=10.0), place(3)), {})
    assert sensors.score("t", (3.0, 5.0), "q").tolist()[:3] == pytest.approx([0.7, 1.0, 0.5])
    assert np.isnan(sensors.score("t", (3.0, 5.0), "q")[3])


def test_where_all_readings_are_equal_low_and_high_prefer_none() -> None:
    sensors = Sensors(map_of(place(0, t=4.0), place(1, t=4.0), place(2)), {})
    assert sensors.score("t", "low", "q").tolist()[:2] == sensors.score("t", "high", "q").tolist()[:2] == [0.5, 0.5]
    assert sensors.score("t", (0.0, 4.0), "q").tolist()[:2] == [1.0, 1.0]
    assert sensors.score("t", (5.0, 6.0), "q").tolist()[:2] == [0.0, 0.0]
    assert np.isnan(sensors.score("t", (5.0, 6.0), "q")[2])


def test_an_unknown_channel_names_those_that_exist() -> None:
    with pytest.raises(InputError, match=r"query 7: no sensor channel 'nvdi'; allowed: light, ndvi"):
        Sensors(map_of(place(0, ndvi=0.3)), {"light": (0, 1)}).score("nvdi", "low", "query 7")
    with pytest.raises(InputError, match="this map has no readings"):
        Sensors(map_of(place(0)), {}).score("ndvi", "low", "q")


@pytest.mark.parametrize("wish", [(2.0, 1.0), (float("nan"), 1.0)])
def test_an_empty_range_is_refused(wish: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="is empty"):
        Sensors(map_of(place(0, t=1.0)), {}).score("t", wish, "q")


def test_several_channels_count_by_the_mean_of_those_read() -> None:
    a, b = np.array([1.0, np.nan, 0.5, np.nan]), np.array([0.0, 0.4, np.nan, np.nan])
    assert mean_known([a, b], 4).tolist()[:3] == [0.5, 0.4, 0.5]
    assert np.isnan(mean_known([a, b], 4)[3])


def test_blending_leaves_scores_alone_where_there_is_nothing_to_blend() -> None:
    assert blend(np.array([0.4, 0.4]), np.array([1.0, np.nan]), 0.5).tolist() == [0.7, 0.4]


def test_theta_is_the_median_distance_from_the_centre() -> None:
    assert auto_theta(map_of(place(0, -30), place(1, -10), place(2, 10), place(3, 30))) == 20.0
    assert auto_theta(map_of(place(0, 5), place(1, 5))) == auto_theta(map_of()) == 1.0


def test_straight_lines_are_distances_in_the_frame_of_the_map() -> None:
    topomap = map_of(place(0, 179.9, 0), place(1, -179.9, 0), frame=Frame.WGS84)
    metres, on_edges = StraightLines(topomap).path_or_straight(Pose(179.9, 0.0), np.array([1, 0]))
    assert metres[0] == pytest.approx(float(distance(Frame.WGS84, (0, 0, 0), (0.2, 0, 0))))
    assert metres[1] == 0.0
    assert not on_edges.any()
