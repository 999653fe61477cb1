"""From which probability on a class is said to be in view."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from erag.evaluate.naming import scores


def best_thresholds(
    chances: npt.NDArray[np.float32], truth: npt.NDArray[np.int8], steadiness: float = 20.0
) -> npt.NDArray[np.float64]:
    """For each class the probability from which on F1 is best, for (n, c) `chances` and `truth` (1, 0, -1 unknown).

    Classes seen rarely keep close to the best common threshold: their own counts as much as their examples do against
    `steadiness`.
    """
    grid = np.arange(0.1, 0.91, 0.02)
    known = truth >= 0
    told = chances[None] >= grid[:, None, None]  # (t, n, c)
    hits = (told & (truth == 1)).sum(axis=1)
    wrong = (told & (truth == 0) & known).sum(axis=1)
    missed = (~told & (truth == 1)).sum(axis=1)
    counts = np.stack([hits, wrong, missed], axis=2)  # (t, c, 3)
    common = float(grid[scores(counts.sum(axis=1))[:, 2].argmax()])
    own = grid[scores(counts)[:, :, 2].argmax(axis=0)]
    support = (truth == 1).sum(axis=0)
    chosen: npt.NDArray[np.float64] = (own * support + common * steadiness) / (support + steadiness)
    return chosen
