"""The maps of real data sets under the default rules: what docs/map.md says of them."""

from pathlib import Path

import numpy as np
import pytest

from erag.core.types import EdgeKind, TopoMap
from erag.data.registry import read
from erag.topomap.build import build_map
from erag.topomap.config import MapConfig
from erag.topomap.report import MapReport
from erag.topomap.routes import Router

pytestmark = pytest.mark.shared


def default_map(source: Path) -> tuple[TopoMap, MapReport]:
    reading = read(source)
    return build_map(reading.frame, reading.observations, reading.edges, MapConfig())


def test_cmu_500_becomes_one_street_map(shared: Path) -> None:
    topomap, report = default_map(shared / "data" / "cmu_500" / "topological_map.gml")
    assert (report.nodes, report.path, report.radius, report.bridge) == (3313, 0, 20_814, 55)
    assert (report.components, report.isolated, report.bridges_left_out) == (1, 0, 0)
    assert report.radius_m == pytest.approx(16.0, abs=0.05)
    assert (report.bridge_total_m, report.bridge_longest_m) == pytest.approx((1637.7, 274.8), abs=0.1)
    router = Router(topomap)
    across = router.route("0", "3312")
    straight = router.path_or_straight(topomap.nodes[0].pose, [3312])[0][0]
    assert across.status == "ok"
    assert across.length_m == pytest.approx(straight)
    assert across.length_m == pytest.approx(1304.9, abs=0.1)
    assert across.bridges == 2
    assert np.isfinite(router.distances([0])).all()


def test_building99_flies_its_path_and_ties_its_objects(shared: Path) -> None:
    topomap, report = default_map(shared / "data" / "building99" / "semantic_forest_gpt.gml")
    assert (report.places, report.objects) == (253, 257)
    assert (report.path, report.radius, report.bridge, report.observed_from) == (252, 0, 0, 257)
    assert (report.components, report.largest, report.unattached, report.issues) == (1, (253,), 0, ())
    ties = topomap.edges.index[:, topomap.edges.kind == EdgeKind.OBSERVED_FROM]
    kinds = {tuple(sorted((topomap.nodes[a].kind, topomap.nodes[b].kind))) for a, b in ties.T}
    assert kinds == {("object", "place")}
    some_object = next(n.id for n in topomap.nodes if n.kind == "object")
    route = Router(topomap).route("drone_252", some_object)
    assert route.status == "ok"
    assert all(name.startswith("drone_") for name in route.nodes)


def test_objects_alone_become_a_map(shared: Path) -> None:
    _, report = default_map(shared / "data" / "building99" / "objects.gml")
    assert (report.places, report.objects) == (0, 1236)
    assert (report.radius, report.bridge, report.components, report.observed_from) == (13_858, 9, 1, 0)
    assert (report.radius_m, report.bridge_longest_m) == pytest.approx((3.9, 10.1), abs=0.05)


def test_coex_keeps_the_edges_it_states(shared: Path) -> None:
    _, report = default_map(shared / "data" / "coex_1f")
    assert (report.nodes, report.path, report.radius, report.bridge) == (50, 49, 91, 0)
    assert (report.components, report.radius_m, report.issues) == (1, None, ())
