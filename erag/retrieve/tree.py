"""Descent through the semantic forest, all queries and branches of a level at once (paper, phase 1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from erag.core.types import NO_PARENT, IntArray
from erag.lm.roles import Vectors
from erag.retrieve.config import TreeConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.flat import NodeScorer, SentenceScorer
from erag.retrieve.rank import Nearness
from erag.retrieve.rows import cluster_vectors
from erag.retrieve.scoring import NOT_FOUND, Batch, LeafScorer, Mask, Reached, Scores, best_first, pair_similarity
from erag.retrieve.spans import leaf_spans


@dataclass(frozen=True, slots=True)
class Choice:
    """One decision: for query `query` of the batch, which of the forest's rows `rows` (r,) below `parent` to follow.

    `parent` is -1 where the rows are roots. The rows are ascending; `best` (r,) is the leaf below each that comes first
    for the query, by score or with the way to it, or n, the number of leaves, where leaves were not scored.
    """

    query: int
    parent: int
    rows: IntArray
    best: IntArray


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


@dataclass(frozen=True)
class _Sight:
    """What a descent sees: `lowest` (q, m) the rank of the best leaf below each row, n where none is eligible.

    `leaf` (q, n + 1) is the leaf of each rank, and n for rank n.
    """

    lowest: IntArray
    leaf: IntArray

    def choice(self, query: int, parent: int, rows: IntArray) -> Choice:
        n = self.leaf.shape[1] - 1
        seen = rows[self.lowest[query, rows] < n]
        return Choice(query, parent, seen, self.leaf[query, self.lowest[query, seen]])


class TreeSearch:
    """Finds leaves by descent. It follows the scores, or whoever `decide` makes of the judge that would follow them.

    With `nearness` the best leaf below a cluster is the one that location and text together put first.
    """

    def __init__(
        self,
        corpus: Corpus,
        config: TreeConfig,
        scorer: LeafScorer,
        decide: Callable[[ClusterJudge], ClusterJudge] | None = None,
        nearness: Nearness | None = None,
    ) -> None:
        self._config, self._scorer, self._decide = config, scorer, decide or (lambda scores: scores)
        self._nearness = nearness
        self._by_score = config.judge.evidence if config.judge else config.evidence > 0 and decide is None
        self._forest, self._leaves = corpus.forest, int(corpus.searchable.sum())
        self._spans = leaf_spans(corpus.forest)
        self._vectors = (corpus.node_vectors, cluster_vectors(corpus, config.cluster_embedding))

    def search(self, batch: Batch, eligible: Mask) -> list[Reached]:
        """See `Search`.

        Leaf scores are computed for all leaves where they are evidence or depend on each other, else only where the
        descent arrives.
        """
        if not self._by_score and isinstance(self._scorer, NodeScorer | SentenceScorer):
            return self._search_lazily(batch, eligible, self._scorer)
        scores = self._scorer.scores(batch)
        evidence = self._evidence(batch, scores)
        rank = _ranks(evidence, eligible & (scores >= 0))
        sight = _Sight(self._spans.lowest(rank), _leaf_of_rank(rank))
        reached, judged = self._descend(batch, sight, self._decide(self._score_judge(evidence, rank, sight.lowest)))
        n = self._forest.n_leaves
        seen = [self._leaves + int((rows >= n).sum()) for rows in judged]
        best = np.where(eligible, scores, NOT_FOUND).max(axis=1, initial=0.0)
        parts = zip(reached, scores, seen, best.tolist(), strict=True)
        return [Reached(r, s[r], v, most) for r, s, v, most in parts]

    def _search_lazily(self, batch: Batch, eligible: Mask, scorer: NodeScorer | SentenceScorer) -> list[Reached]:
        n = self._forest.n_leaves
        lowest = self._spans.lowest(np.where(eligible, np.arange(n), n))
        sight = _Sight(lowest, np.full((len(batch), n + 1), n, np.int64))
        reached, judged = self._descend(batch, sight, self._decide(ScoreJudge(*self._vectors, lowest, None, 0.0)))
        queries = np.repeat(np.arange(len(batch)), [len(r) for r in reached])
        scores = scorer.pair_scores(batch, queries, np.concatenate(reached))
        ends = np.cumsum([len(r) for r in reached])[:-1]
        seen = [len(np.union1d(rows, below)) for rows, below in zip(judged, reached, strict=True)]
        parts = zip(reached, np.split(scores, ends), seen, strict=True)
        return [Reached(r[s >= 0], s[s >= 0], v) for r, s, v in parts]

    def _evidence(self, batch: Batch, scores: Scores) -> Scores:
        """What speaks for each leaf (q, n): its score, with where the query is asked from."""
        if self._nearness is None or batch.spatial is None:
            return scores
        return self._nearness.joined(scores.astype(np.float64), batch.spatial).astype(np.float32)

    def _score_judge(self, scores: Scores, rank: IntArray, lowest: IntArray) -> ScoreJudge:
        """The built-in judge: scores are sorted, so that the lowest rank below a row tells its best score."""
        q, n = scores.shape
        by_rank = np.zeros((q, n + 1), np.float32)  # the last one stands for rows that are passed by
        np.put_along_axis(by_rank, rank, scores, axis=1)
        best = np.take_along_axis(by_rank, lowest, axis=1)
        return ScoreJudge(*self._vectors, lowest, best, self._config.evidence)

    def _descend(self, batch: Batch, sight: _Sight, judge: ClusterJudge) -> tuple[list[IntArray], list[IntArray]]:
        """Leaves reached and rows judged by each query. Rows with no eligible leaf below are passed by."""
        n = self._forest.n_leaves
        reached, judged = _Rows(len(batch)), _Rows(len(batch))
        front = self._below([(query, NO_PARENT) for query in range(len(batch))], sight)
        while front:
            if self._config.leaves == "all":
                for choice in front:
                    reached.add(choice.query, choice.rows[choice.rows < n])
                front = [sight.choice(c.query, c.parent, c.rows[c.rows >= n]) for c in front]
            asked = [choice for choice in front if len(choice.rows)]
            if not asked:
                break
            opened: list[tuple[int, int]] = []
            for choice, rows in zip(asked, judge.choose(batch, asked, self._config.branches), strict=True):
                judged.add(choice.query, choice.rows)
                reached.add(choice.query, rows[rows < n])
                opened.extend((choice.query, int(row)) for row in rows[rows >= n])
            front = self._below(opened, sight)
        return reached.sorted(), judged.sorted()

    def _below(self, opened: Sequence[tuple[int, int]], sight: _Sight) -> list[Choice]:
        forest = self._forest
        return [
            sight.choice(query, row, forest.roots if row == NO_PARENT else forest.children[row])
            for query, row in opened
        ]


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


def _leaf_of_rank(rank: IntArray) -> IntArray:
    """(q, n + 1): the leaf at each place of `rank` (q, n); n where no leaf has it."""
    q, n = rank.shape
    out = np.full((q, n + 1), n, np.int64)
    np.put_along_axis(out, rank, np.broadcast_to(np.arange(n), (q, n)), axis=1)
    out[:, n] = n
    return out
