"""The clustering benchmark: generated maps, measurements in processes of their own, the table."""

from __future__ import annotations

import numpy as np

from erag.bench.clustering import columns, perturbed_copies, run
from erag.bench.memory import peak_mb


def test_copies_are_similar_but_not_equal_and_lie_apart() -> None:
    positions, vectors = perturbed_copies(7000, 0)
    again, _ = perturbed_copies(7000, 0)
    other, _ = perturbed_copies(7000, 1)
    assert (positions == again).all()
    assert not (positions == other).all()
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-5)
    to_copy = (vectors[:3000] * vectors[3000:6000]).sum(axis=1)
    assert 0.75 < to_copy.mean() < 0.85
    assert len(np.unique(positions, axis=0)) == 7000


def test_a_run_measures_each_size_and_makes_a_table() -> None:
    rows = list(run([300], 0))
    assert [(r.nodes, r.method, r.same) for r in rows] == [
        (300, "full matrix", None),
        (300, "passes", True),
        (300, "forest", None),
    ]
    assert all(r.seconds > 0 and 10 < r.peak_mb < 2000 for r in rows)
    names, cells = columns(rows)
    assert all(len(line) == len(names) for line in cells)
    assert cells[1][names.index("as scipy")] == "yes"
    assert rows[0].digest == rows[1].digest != rows[2].digest


def test_peak_memory_covers_what_was_held() -> None:
    before = peak_mb()
    held = np.ones(int((before + 100) * 125_000))
    assert peak_mb() >= held.nbytes / 1e6 > before
