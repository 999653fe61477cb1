"""How far a pass should look: thresholds guessed from samples of the map. A wrong guess costs time, never exactness."""

from __future__ import annotations

import math

import numpy as np

from erag.forest.affinity import Doubles
from erag.forest.search import Table

SAMPLE_ROWS = 2000  # rows whose pairs are measured to guess a threshold
MEMBERS = 3  # rows of a cluster in the sample
PAIRS_PER_CLUSTER = 12  # pairs a cluster that a pass looks for: merging thrives on few, and few are fast
LOCAL_PAIRS = 2  # pairs a cluster that make it worth while to look near by first
LOCAL_THETAS = 2.0  # how far near by is


def height_for(clusters: Table, goal: int, limit: int) -> float:
    """A height within which a pass should find enough pairs of clusters, and at most about 3/4 of `limit`.

    Enough are PAIRS_PER_CLUSTER, or fewer where few merges are left to `goal` clusters. Drawn from all pairs of a
    sample of clusters; infinite when all pairs are not more than that. Lower where a height that only near pairs can
    reach already gives a few pairs a cluster.
    """
    m = len(clusters)
    share_left = max(1 / PAIRS_PER_CLUSTER, min(1.0, 2.0 * (1.0 - goal / m)))
    wanted = min(PAIRS_PER_CLUSTER * m * share_left, limit * 3 // 4)
    total = m * (m - 1) / 2
    if wanted >= total:
        return math.inf
    sample = np.sort(_sample(clusters))
    height = float(np.quantile(sample, wanted / total))
    local = (1.0 - clusters.rows.alpha) * (1.0 - math.exp(-LOCAL_THETAS))
    worth = np.searchsorted(sample, local) / len(sample) * total >= LOCAL_PAIRS * m
    return min(height, local) if worth else height


def _sample(clusters: Table) -> Doubles:
    """Dissimilarities of all pairs of some clusters drawn with a fixed seed, each by at most MEMBERS of its rows.

    Not at a fixed stride: that would keep near ones apart.
    """
    each = min(MEMBERS, -(-len(clusters.rows) // len(clusters)))
    some = min(len(clusters), SAMPLE_ROWS // each)
    taken = np.sort(np.random.default_rng(0).choice(len(clusters), some, replace=False))
    used = np.minimum(clusters.size[taken], MEMBERS)
    begin = np.cumsum(used) - used
    number = np.arange(used.sum()) - np.repeat(begin, used)  # 0, 1, … within a cluster
    spread = number * np.repeat(clusters.size[taken] // used, used)
    matrix = clusters.rows.take(np.repeat(clusters.start[taken], used) + spread).block(slice(None), slice(None))
    between = np.maximum.reduceat(np.maximum.reduceat(matrix, begin, axis=0), begin, axis=1)
    return np.asarray(between[np.triu_indices(len(begin), 1)])
