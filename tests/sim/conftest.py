"""A small data set that the tests of the simulator share."""

from __future__ import annotations

from pathlib import Path

import pytest

WORLDS = ("house",)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The world `house`, which is visited twice, built at a tiny size. Read only."""
    pytest.importorskip("pybullet", reason="the extra `sim` is not installed")
    from erag.sim.camera import Size
    from erag.sim.dataset import Plan, build

    out = tmp_path_factory.mktemp("sim") / "set"
    build(out, Plan(WORLDS, size=Size(96, 72)))
    return out
