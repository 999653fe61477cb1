"""Trips over small maps: routes, noise, blocked edges, and what counts as having arrived."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.geometry import distance
from erag.core.types import EdgeKind, Edges, Frame, Observation, Pose, TopoMap
from erag.evaluate.navigation.planner import Drive, FollowerConfig, Leg, WaypointFollower
from erag.evaluate.navigation.trips import (
    Course,
    Trip,
    end_to_end,
    navigation_score,
    random_blockages,
    without,
)

EXACT = WaypointFollower(FollowerConfig(noise=0))


def world(points: dict[str, tuple[float, float]], links: list[str], frame: Frame = Frame.METRIC) -> TopoMap:
    """Nodes of one letter each; links as pairs of letters."""
    names = list(points)
    nodes = tuple(Observation(n, "place", Pose(*points[n]), caption=n) for n in names)
    index = np.array([[names.index(a), names.index(b)] for a, b in links], np.int64).reshape(-1, 2).T
    at = np.array([n.pose.xyz for n in nodes]).reshape(-1, 3)
    metres = distance(frame, at[index[0]], at[index[1]])
    return TopoMap(frame, nodes, Edges(index, np.full(len(links), EdgeKind.PATH, np.int8), metres))


# a ring of 10 m sides: a - b - c - d - a, and e that nothing leads to
RING = world({"a": (0, 0), "b": (10, 0), "c": (10, 10), "d": (0, 10), "e": (500, 0)}, ["ab", "bc", "cd", "da"])
AB = frozenset("ab")


def test_without_noise_the_way_is_the_route() -> None:
    trip = Course(RING, EXACT).trip(Pose(0, 0), "c")
    assert trip == Trip("arrived", pytest.approx(20), pytest.approx(20), pytest.approx(0), 0)
    assert trip.spl == pytest.approx(1)


def test_the_way_begins_where_the_robot_stands() -> None:
    trip = Course(RING, EXACT).trip(Pose(-5, 0), "b")
    assert (trip.metres, trip.shortest_m) == (pytest.approx(15), pytest.approx(15))
    assert Course(RING, EXACT).trip(Pose(10, 0), "b") == Trip("arrived", 0, 0, 0, 0)


def test_a_blocked_edge_costs_the_way_there_and_back() -> None:
    """a-b is shut: 5 m to notice it, 5 m back, then a-d-c-b; the shortest open way is 30 m."""
    trip = Course(RING, EXACT, {AB}).trip(Pose(0, 0), "b")
    assert trip == Trip("arrived", pytest.approx(40), pytest.approx(30), pytest.approx(0), 1)
    assert trip.spl == pytest.approx(3 / 4)


def test_a_barrier_seen_at_once_costs_nothing_but_the_detour() -> None:
    planner = WaypointFollower(FollowerConfig(noise=0, notice=0))
    trip = Course(RING, planner, {AB}).trip(Pose(0, 0), "b")
    assert (trip.metres, trip.replans) == (pytest.approx(30), 1)


def test_no_open_way_is_found_out_by_trying() -> None:
    """To c from a: a-b-c is shut after b, back to a, a-d-c after d: 10 + 5 + 5 + 10 + 10 + 5, and it stands there."""
    trip = Course(RING, EXACT, {frozenset("bc"), frozenset("cd")}).trip(Pose(0, 0), "c")
    assert (trip.status, trip.replans, trip.shortest_m, trip.spl) == ("blocked", 2, None, 0)
    assert trip.metres == pytest.approx(45)
    assert trip.error_m == pytest.approx(5)


def test_what_the_map_has_no_way_to_is_not_tried() -> None:
    course = Course(RING, EXACT)
    assert course.trip(Pose(0, 0), "e") == Trip("no_route")
    assert course.trip(None, "a") == Trip("no_route")
    assert course.trip(Pose(200, 200), "a") == Trip("no_route")
    with pytest.raises(InputError, match="no node 'z'"):
        course.trip(Pose(0, 0), "z")
    empty = TopoMap(Frame.METRIC, (), Edges.empty())
    with pytest.raises(InputError, match="the map is empty"):
        Course(empty, EXACT).trip(Pose(0, 0), "a")


def test_noise_misses_a_narrow_goal_and_the_same_seed_drives_the_same() -> None:
    noisy = WaypointFollower(FollowerConfig(noise=2.0, arrival=1.0))
    course = Course(RING, noisy, success_m=0.5)
    trips = [course.trip(Pose(0, 0), "c", seed) for seed in range(40)]
    assert trips == [course.trip(Pose(0, 0), "c", seed) for seed in range(40)]
    statuses = {t.status for t in trips}
    assert statuses == {"arrived", "missed"}
    assert all((t.error_m <= 0.5) == (t.status == "arrived") for t in trips if t.error_m is not None)
    assert all(0 < t.spl <= 1 for t in trips if t.status == "arrived")


def test_more_noise_arrives_less_often() -> None:
    def arrived(noise: float) -> int:
        course = Course(RING, WaypointFollower(FollowerConfig(noise=noise)), success_m=1.0)
        return sum(course.trip(Pose(0, 0), "c", seed).status == "arrived" for seed in range(60))

    assert arrived(0.1) == 60 > arrived(1.0) > arrived(4.0)


def test_a_planner_that_gives_up_is_lost() -> None:
    lost = WaypointFollower(FollowerConfig(noise=1e6, patience=1.0))
    assert Course(RING, lost).trip(Pose(0, 0), "b").status == "lost"


def test_any_planner_fits() -> None:
    class Teleport:
        def follow(self, start: np.ndarray, legs: list[Leg], seed: int) -> Drive:
            return Drive(legs[-1].target, 0.0, len(legs), "arrived")

    trip = Course(RING, Teleport(), {AB}).trip(Pose(0, 0), "b")
    assert (trip.status, trip.metres, trip.spl) == ("arrived", 0, 1)


def test_street_maps_are_driven_in_metres() -> None:
    degree = 0.0001  # 11.1 m north, 7 m east at 51° N
    street = world({"a": (1, 51), "b": (1 + degree, 51), "c": (1 + degree, 51 + degree)}, ["ab", "bc"], Frame.WGS84)
    trip = Course(street, EXACT).trip(Pose(1, 51), "c")
    assert trip.shortest_m == pytest.approx(11.12 + 7.0, abs=0.05)
    assert trip.metres == pytest.approx(trip.shortest_m, rel=1e-4)


def test_the_antimeridian_is_no_obstacle() -> None:
    pacific = world({"a": (179.9999, 0), "b": (-179.9999, 0)}, ["ab"], Frame.WGS84)
    trip = Course(pacific, EXACT).trip(Pose(179.9999, 0), "b")
    assert trip.status == "arrived"
    assert trip.metres == pytest.approx(22.24, abs=0.05)


def test_blockages_are_drawn_by_seed() -> None:
    assert random_blockages(RING, 0) == frozenset()
    assert random_blockages(RING, 1) == {frozenset(p) for p in ("ab", "bc", "cd", "da")}
    half = random_blockages(RING, 0.5, seed=1)
    assert len(half) == 2
    assert half == random_blockages(RING, 0.5, seed=1)
    assert {random_blockages(RING, 0.25, seed=s) for s in range(20)} > {random_blockages(RING, 0.25)}
    assert len(without(RING, half).edges) == 2
    with pytest.raises(ValueError, match="share of blocked edges"):
        random_blockages(RING, 1.5)


def test_scores_by_hand() -> None:
    trips = [Trip("arrived", 40, 30, 0, 1), Trip("missed", 30, 30, 9, 0), Trip("no_route"), Trip("arrived", 5, 5, 0, 0)]
    found = navigation_score(trips)
    assert (found.trips, found.success.mean, found.spl.mean) == (4, 0.5, pytest.approx(1.75 / 4))
    assert found.statuses == {"arrived": 2, "missed": 1, "no_route": 1}
    assert found.replans == 0.25
    with pytest.raises(ValueError, match="finite values"):
        navigation_score([])


def test_getting_there_and_being_right_are_told_apart() -> None:
    trips = [Trip("arrived", 1, 1), Trip("missed", 1, 1), Trip("arrived", 1, 1), Trip("no_route")]
    assert end_to_end([1.0, 1.0, 0.0, 0.0], trips) == (0.5, 0.5, 0.25)
    with pytest.raises(ValueError, match="one each a query"):
        end_to_end([1.0], trips)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=6), st.floats(0.1, 3))
def test_an_exact_follower_drives_the_polyline(points: list[tuple[float, float]], step: float) -> None:
    planner = WaypointFollower(FollowerConfig(noise=0, step=step))
    legs = [Leg(np.array([x, y, 1.0])) for x, y in points]
    drive = planner.follow(np.zeros(3), legs, 0)
    corners = [np.zeros(3), *(leg.target for leg in legs)]
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(corners))
    assert (drive.ending, drive.finished) == ("arrived", len(legs))
    assert drive.metres == pytest.approx(length, rel=1e-6, abs=1e-6)
    assert drive.position == pytest.approx(legs[-1].target, abs=1e-6)


@given(st.integers(0, 1000), st.floats(0, 1), st.floats(0, 2))
def test_no_trip_beats_the_shortest_open_way_by_more_than_its_slack(seed: int, share: float, noise: float) -> None:
    config = FollowerConfig(noise=noise)
    trip = Course(RING, WaypointFollower(config), random_blockages(RING, share, seed)).trip(Pose(0, 0), "c", seed)
    assert 0 <= trip.spl <= 1
    if trip.status == "arrived":
        assert trip.shortest_m is not None
        slack = 3 * 2 * (config.arrival + 8 * noise)  # corners are cut by what the robot takes for having arrived
        assert trip.metres >= trip.shortest_m - slack - 3.0
    assert not math.isnan(trip.metres)
