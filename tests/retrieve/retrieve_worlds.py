"""Small random corpora for the retrieval tests: words, vectors of words, and forests that skip levels."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from erag.core.text import words
from erag.core.types import Cluster, Edges, Forest, Frame, IntArray, Interval, Observation, Pose, Query, TopoMap
from erag.lm.roles import Vectors
from erag.retrieve.corpus import Corpus, map_texts, split_sentences

DIM = 12
VOCABULARY = (
    *("bench", "tree", "road", "bicycle", "café", "fountain", "statue", "grass"),
    *("river", "bridge", "library", "door", "sign", "shop", "lamp", "hill"),
)


def embed(texts: Sequence[str]) -> Vectors:
    """(n, DIM) unit rows: sums of a fixed positive direction for each word; zeros for a text without words."""
    rows = np.zeros((len(texts), DIM))
    for row, text in zip(rows, texts, strict=True):
        for word in words(text):
            row += _direction(word)
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    return (rows / np.where(norms > 0, norms, 1)).astype(np.float32)


@lru_cache
def _direction(word: str) -> np.ndarray:
    return np.random.default_rng(zlib.crc32(word.encode())).random(DIM) ** 3


def corpus_of(nodes: Sequence[Observation], forest: Forest | None = None, frame: Frame = Frame.METRIC) -> Corpus:
    """A corpus of observations; without a forest every node is a root."""
    topomap = TopoMap(frame, tuple(nodes), Edges.empty())
    texts = map_texts(topomap)
    spoken, rows = split_sentences(texts)
    vectors = embed(texts)
    known = forest or flat_forest([n.id for n in nodes], vectors)
    summaries = embed([c.summary for c in known.clusters])
    return Corpus(topomap, known, texts, vectors, embed(spoken), rows, summaries)


def flat_forest(ids: Sequence[str], vectors: Vectors) -> Forest:
    n = len(ids)
    return Forest(tuple(ids), (), np.full(n, -1, np.int64), np.zeros(n, np.int64), vectors)


def random_nodes(rng: np.random.Generator, n: int, textless: float = 0.2) -> list[Observation]:
    """Places with captions of one to three sentences, some without any, with times and readings here and there."""
    nodes = []
    for i in range(n):
        said = [" ".join(rng.choice(VOCABULARY, rng.integers(1, 5))).capitalize() for _ in range(rng.integers(1, 4))]
        start = float(rng.integers(0, 1000))
        nodes.append(
            Observation(
                id=f"n{i}",
                kind="place",
                pose=Pose(*(float(v) for v in rng.uniform(-100, 100, 3))),
                time=None if rng.random() < 0.3 else Interval(start, start + float(rng.integers(0, 200))),
                caption=None if rng.random() < textless else ". ".join(said) + ".",
                sensors={} if rng.random() < 0.3 else {"ndvi": float(rng.random())},
            )
        )
    return nodes


def random_forest(rng: np.random.Generator, nodes: Sequence[Observation]) -> Forest:
    """Levels of random clusters; some rows join none and are carried on, and several roots are left."""
    n = len(nodes)
    parent, level, groups, tops = [-1] * n, [0] * n, [], list(range(n))
    for depth in range(1, int(rng.integers(1, 5))):
        joining = [row for row in tops if rng.random() < 0.8]
        for group in np.array_split(rng.permutation(joining), max(1, len(joining) // 3)):
            if len(group) < 2:
                continue
            for row in group:
                parent[int(row)] = len(parent)
            groups.append([int(row) for row in group])
            parent.append(-1)
            level.append(depth)
        tops = [row for row in range(len(parent)) if parent[row] == -1]
    return _forest(rng, nodes, parent, level, groups)


def _forest(
    rng: np.random.Generator,
    nodes: Sequence[Observation],
    parent: list[int],
    level: list[int],
    groups: list[list[int]],
) -> Forest:
    n = len(nodes)
    ids = [node.id for node in nodes] + [f"c{i}" for i in range(len(groups))]
    clusters = tuple(
        Cluster(
            id=ids[n + i],
            level=level[n + i],
            members=tuple(ids[row] for row in rows),
            position=(0.0, 0.0, 0.0),
            mean_distance=0.0,
            summary=" ".join(rng.choice(VOCABULARY, 3)) if rng.random() < 0.7 else "",
        )
        for i, rows in enumerate(groups)
    )
    noise = rng.random((len(groups), DIM)) ** 3 + 1e-3
    means = (noise / np.linalg.norm(noise, axis=1, keepdims=True)).astype(np.float32)
    vectors = embed([node.caption or "" for node in nodes])
    return Forest(
        tuple(ids[:n]), clusters, np.array(parent, np.int64), np.array(level, np.int64), np.vstack([vectors, means])
    )


def random_corpus(seed: int, n: int = 40, distinct: bool = False) -> Corpus:
    """A random map with a random forest; `distinct` gives every caption a word of its own, so that none tie."""
    rng = np.random.default_rng(seed)
    nodes = random_nodes(rng, n)
    if distinct:
        nodes = [replace(o, caption=o.caption and f"{o.caption[:-1]} number{i}.") for i, o in enumerate(nodes)]
    return corpus_of(nodes, random_forest(rng, nodes))


def random_queries(seed: int, count: int = 5, top: int = 5) -> tuple[list[Query], Vectors]:
    """Queries of one to four words of the vocabulary, with their vectors (q, DIM)."""
    rng = np.random.default_rng(seed + 1)
    texts = [" ".join(rng.choice(VOCABULARY, rng.integers(1, 5))) for _ in range(count)]
    return [Query(text, id=f"q{i}", top=top) for i, text in enumerate(texts)], embed(texts)


def permuted(corpus: Corpus, order: IntArray) -> Corpus:
    """The same corpus with its nodes in another order; clusters keep theirs."""
    n = len(order)
    old, forest = np.concatenate([order, np.arange(n, len(corpus.forest.parent))]), corpus.forest
    moved = replace(
        forest,
        leaves=tuple(forest.leaves[i] for i in order),
        parent=forest.parent[old],
        level=forest.level[old],
        embeddings=forest.embeddings[old],
    )
    return corpus_of([corpus.topomap.nodes[i] for i in order], moved, corpus.topomap.frame)
