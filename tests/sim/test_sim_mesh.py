"""Meshes: closed, and facing outwards."""

from __future__ import annotations

import numpy as np
import pytest

from erag.sim.mesh import Mesh, bars, box, cylinder, merge, panel, prism, rod, sheet, sphere, wheel

CAR = ((-2, 0.3), (2, 0.3), (2.1, 0.7), (1, 0.9), (-2, 0.95))


def volume(mesh: Mesh) -> float:
    """Signed volume by the divergence theorem: positive where all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (box(1, 2, 3), 6.0),
        (box(1, 2, 3, (5, -4, 2)).turned(33, "x"), 6.0),
        (prism(((-1, 0), (1, 0), (0, 2)), 3.0), 6.0),
        (sphere(1.0, sides=48), 4.15),
        (cylinder(1.0, 2.0, sides=64), 6.27),
        (wheel(1.0, 2.0, (3, 3, 3)), 6.12),
        (rod((0, 0, 0), (0, 3, 4), 1.0, 64), 15.68),
    ],
)
def test_solids_are_closed_and_face_outwards(mesh: Mesh, expected: float) -> None:
    assert volume(mesh) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("mesh", [box(1, 2, 3), prism(CAR, 1.7), sphere(1.0), rod((0, 0, 0), (1, 1, 1), 0.1)])
def test_normals_agree_with_the_winding(mesh: Mesh) -> None:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    real = np.linalg.norm(flat, axis=1) > 1e-9
    assert (np.einsum("ij,ij->i", flat, mesh.normals[mesh.faces[:, 0]])[real] > 0).all()


def test_a_rod_ends_where_it_should() -> None:
    mesh = rod((1, 2, 3), (4, 2, 3), 0.1)
    assert mesh.vertices[:, 0].min() == pytest.approx(1)
    assert mesh.vertices[:, 0].max() == pytest.approx(4)
    assert np.abs(mesh.vertices[:, 1] - 2).max() <= 0.1 + 1e-9


def test_merging_keeps_every_face() -> None:
    parts = [box(1, 1, 1), sphere(1.0), sheet(2, 2)]
    whole = merge(parts)
    assert len(whole.faces) == sum(len(p.faces) for p in parts)
    assert whole.faces.max() == len(whole.vertices) - 1


def test_a_picture_reads_from_left_to_right_from_its_front() -> None:
    face = panel(2.0, 1.0)
    left = face.vertices[face.uvs[:, 0] == 0]
    assert (left[:, 1] == -1).all()  # seen from +x, −y is on the left
    assert (face.vertices[face.uvs[:, 1] == 1][:, 2] == 1).all()
    assert (face.normals @ np.array((1, 0, 0)) > 0.99).all()


def test_bars_join_the_points() -> None:
    mesh = bars(((0, 0, 0), (1, 0, 0), (1, 1, 0)), 0.05)
    assert mesh.vertices.max(0) == pytest.approx((1.05, 1.0, 0.05), abs=0.06)
