"""Descent through the semantic forest, all queries and branches of a level at once (paper, phase 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from erag.core.types import NO_PARENT, IntArray
from erag.lm.roles import Vectors
from erag.retrieve.config import TreeConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.flat import NodeScorer, SentenceScorer
from erag.retrieve.rows import cluster_vectors
from erag.retrieve.scoring import Batch, LeafScorer, Mask, Reached, Scores, best_first, pair_similarity
from erag.retrieve.spans import leaf_spans


@dataclass(frozen=True, slots=True)
class Choice:
    """One decision: for query `query` of the batch, which of the forest's rows `rows` (r,) below `parent` to follow.

    `parent` is -1 where the rows are roots. The rows are ascending.
    """

    query: int
    parent: int
    rows: IntArray


class ClusterJudge(Protocol):
    """Who decides: the scores, or a language model that reads the cards of the candidates."""

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        """For each choice min(k, r) distinct rows out of its rows, best first; independent of their order."""
        ...


@dataclass(frozen=True)
class ScoreJudge:
    """Decides by `evidence` × (best leaf score below) + (1 - `evidence`) × (similarity of the row to the query).

    `leaves` (n, d) and `clusters` (c, d) hold the vectors of the forest's rows; `best` (q, m) the best leaf score below
    each row, None with evidence 0. Rows that score the same are taken by the `rank` (q, m) of the best leaf below them.
    """

    leaves: Vectors
    clusters: Vectors
    rank: IntArray
    best: Scores | None
    evidence: float

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        """See `ClusterJudge`."""
        sizes = [len(c.rows) for c in choices]
        rows = np.concatenate([c.rows for c in choices])
        queries = np.repeat(np.array([c.query for c in choices], np.int64), sizes)
        scores = self._scores(batch, queries, rows)
        ranks, bounds = self.rank[queries, rows], np.cumsum([0, *sizes])
        parts = [slice(a, b) for a, b in pairwise(bounds)]
        return [rows[part][best_first(scores[part], ranks[part], rows[part])[:k]] for part in parts]

    def _scores(self, batch: Batch, queries: IntArray, rows: IntArray) -> Scores:
        if self.best is None:
            return self._own(batch, queries, rows)
        if self.evidence == 1.0:
            return self.best[queries, rows]
        blend = self.evidence * self.best[queries, rows] + (1 - self.evidence) * self._own(batch, queries, rows)
        return np.asarray(blend, np.float32)

    def _own(self, batch: Batch, queries: IntArray, rows: IntArray) -> Scores:
        """The similarity (p,) of forest rows (p,) to queries (p,), whatever lies below them."""
        n, out = len(self.leaves), np.empty(len(rows), np.float32)
        leaf = rows < n
        out[leaf] = pair_similarity(self.leaves, batch.vectors, queries[leaf], rows[leaf])
        out[~leaf] = pair_similarity(self.clusters, batch.vectors, queries[~leaf], rows[~leaf] - n)
        return out


class TreeSearch:
    """Finds leaves by descent. With `judge` the descent follows it; otherwise it follows the scores."""

    def __init__(
        self, corpus: Corpus, config: TreeConfig, scorer: LeafScorer, judge: ClusterJudge | None = None
    ) -> None:
        self._config, self._scorer, self._judge = config, scorer, judge
        self._forest, self._leaves = corpus.forest, int(corpus.searchable.sum())
        self._spans = leaf_spans(corpus.forest)
        self._vectors = (corpus.node_vectors, cluster_vectors(corpus, config.cluster_embedding))

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`.

        Leaf scores are computed for all leaves where they are evidence or depend on each other, else only where the
        descent arrives.
        """
        without_evidence = self._config.evidence == 0.0 or self._judge is not None
        if without_evidence and isinstance(self._scorer, NodeScorer | SentenceScorer):
            return self._search_lazily(batch, eligible, self._scorer)
        scores = self._scorer.scores(batch)
        rank = _ranks(scores, eligible & (scores >= 0))
        lowest = self._spans.lowest(rank)  # (q, m)
        reached, judged = self._descend(batch, lowest, self._judge or self._score_judge(scores, rank, lowest))
        n = self._forest.n_leaves
        seen = [self._leaves + int((rows >= n).sum()) for rows in judged]
        return [Reached(r, s[r], v) for r, s, v in zip(reached, scores, seen, strict=True)]

    def _search_lazily(self, batch: Batch, eligible: Mask, scorer: NodeScorer | SentenceScorer) -> list[Reached]:
        n = self._forest.n_leaves
        lowest = self._spans.lowest(np.where(eligible, np.arange(n), n))
        judge = self._judge or ScoreJudge(*self._vectors, lowest, None, 0.0)
        reached, judged = self._descend(batch, lowest, judge)
        queries = np.repeat(np.arange(len(batch)), [len(r) for r in reached])
        scores = scorer.pair_scores(batch, queries, np.concatenate(reached))
        ends = np.cumsum([len(r) for r in reached])[:-1]
        seen = [len(np.union1d(rows, below)) for rows, below in zip(judged, reached, strict=True)]
        parts = zip(reached, np.split(scores, ends), seen, strict=True)
        return [Reached(r[s >= 0], s[s >= 0], v) for r, s, v in parts]

    def _score_judge(self, scores: Scores, rank: IntArray, lowest: IntArray) -> ScoreJudge:
        """The built-in judge: scores are sorted, so that the lowest rank below a row tells its best score."""
        q, n = scores.shape
        by_rank = np.zeros((q, n + 1), np.float32)  # the last one stands for rows that are passed by
        np.put_along_axis(by_rank, rank, scores, axis=1)
        best = np.take_along_axis(by_rank, lowest, axis=1)
        return ScoreJudge(*self._vectors, lowest, best, self._config.evidence)

    def _descend(self, batch: Batch, lowest: IntArray, judge: ClusterJudge) -> tuple[list[IntArray], list[IntArray]]:
        """Leaves reached and rows judged by each query. Rows with no eligible leaf below, rank n, are passed by."""
        n, alive = self._forest.n_leaves, lowest < self._forest.n_leaves
        reached, judged = _Rows(len(batch)), _Rows(len(batch))
        front = self._below([(query, NO_PARENT) for query in range(len(batch))], alive)
        while front:
            if self._config.leaves == "all":
                for choice in front:
                    reached.add(choice.query, choice.rows[choice.rows < n])
                front = [Choice(c.query, c.parent, c.rows[c.rows >= n]) for c in front]
            asked = [choice for choice in front if len(choice.rows)]
            if not asked:
                break
            opened: list[tuple[int, int]] = []
            for choice, rows in zip(asked, judge.choose(batch, asked, self._config.branches), strict=True):
                judged.add(choice.query, choice.rows)
                reached.add(choice.query, rows[rows < n])
                opened.extend((choice.query, int(row)) for row in rows[rows >= n])
            front = self._below(opened, alive)
        return reached.sorted(), judged.sorted()

    def _below(self, opened: Sequence[tuple[int, int]], alive: Mask) -> list[Choice]:
        choices = []
        for query, row in opened:
            rows = self._forest.roots if row == NO_PARENT else self._forest.children[row]
            choices.append(Choice(query, row, rows[alive[query, rows]]))
        return choices


class _Rows:
    """Rows gathered for each query."""

    def __init__(self, queries: int) -> None:
        self._parts: list[list[IntArray]] = [[np.empty(0, np.int64)] for _ in range(queries)]

    def add(self, query: int, rows: IntArray) -> None:
        self._parts[query].append(rows)

    def sorted(self) -> list[IntArray]:
        return [np.sort(np.concatenate(parts)) for parts in self._parts]


def _ranks(scores: Scores, kept: Mask) -> IntArray:
    """The place (q, n) of each kept leaf by descending score, then by row; n for the others."""
    n = scores.shape[1]
    out = np.full(scores.shape, n, np.int64)
    for row, score, keep in zip(out, scores, kept, strict=True):
        rows = np.flatnonzero(keep)
        row[rows[best_first(score[rows], rows)]] = np.arange(len(rows))
    return out
