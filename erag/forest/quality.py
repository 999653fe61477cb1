"""How good the summaries of a forest are, whoever wrote them: member-fact coverage and unsupported statements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.types import Cluster, Forest, IntArray, TopoMap
from erag.forest.facts import FactsConfig, cluster_facts
from erag.forest.support import Evidence, check, coverage
from erag.forest.vocabulary import Vocabulary, map_vocabulary
from erag.lm.roles import Summary


@dataclass(frozen=True, slots=True)
class Quality:
    """Of `clusters` with facts, `described` have a summary; `covered` sums the shares of facts mentioned (0 for none).

    `statements` are names, sentences and relationships; `unsupported` those that no member bears out.
    """

    clusters: int
    described: int
    covered: float
    statements: int
    unsupported: int

    @property
    def coverage(self) -> float:
        """Member-fact coverage in [0, 1], a mean over clusters."""
        return self.covered / self.clusters if self.clusters else 0.0

    @property
    def unsupported_rate(self) -> float:
        """Unsupported statements a statement, in [0, 1]."""
        return self.unsupported / self.statements if self.statements else 0.0

    def line(self) -> str:
        """One line for a report."""
        return (
            f"{self.described} of {self.clusters} clusters described; they mention {100 * self.coverage:.0f} % of "
            f"their facts; {self.unsupported} of {self.statements} statements unsupported "
            f"({100 * self.unsupported_rate:.1f} %)"
        )


def forest_quality(topomap: TopoMap, forest: Forest, config: FactsConfig | None = None) -> Mapping[int, Quality]:
    """The quality of a forest's summaries by level, for those we wrote and for those a source states alike.

    Facts are those that `SummaryConfig` tells a summariser, signs left out, over all base nodes of each cluster.
    """
    words, below = map_vocabulary(topomap), base_nodes(forest)
    levels = sorted({c.level for c in forest.clusters})
    return {level: _quality(words, forest.clusters, below, level, config) for level in levels}


def _quality(
    words: Vocabulary, clusters: Sequence[Cluster], below: Sequence[IntArray], level: int, config: FactsConfig | None
) -> Quality:
    told = described = statements = unsupported = 0
    covered = 0.0
    for cluster, rows in zip(clusters, below, strict=True):
        if cluster.level != level:
            continue
        known = tuple(cluster_facts(words, rows, config))
        facts = [f for f in known if f.entry.kind != "sign"]
        if not facts:
            continue
        summary = Summary(cluster.name, cluster.summary, cluster.relationships)
        checked = check(summary, Evidence(words, rows, known, measured=True))
        told += 1
        described += bool(cluster.summary)
        covered += coverage(summary, facts) if cluster.summary else 0.0
        statements += checked.statements
        unsupported += len(checked.removed)
    return Quality(told, described, covered, statements, unsupported)


def base_nodes(forest: Forest) -> list[IntArray]:
    """The rows of the base nodes below each cluster, ascending."""
    n = forest.n_leaves
    found: list[list[int]] = [[] for _ in forest.clusters]
    for leaf in range(n):
        up = int(forest.parent[leaf])
        while up >= 0:
            found[up - n].append(leaf)
            up = int(forest.parent[up])
    return [np.array(rows, np.int64) for rows in found]
