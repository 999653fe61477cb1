"""Embeddings in fewer bytes: int8 and bits, with and without rescoring, against float32."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray
from erag.lm.roles import Vectors

Bytes = npt.NDArray[np.int8]
Words = npt.NDArray[np.uint64]
_LEVELS = 127


@dataclass(frozen=True, eq=False)
class Eighths:
    """Vectors (n, d) as int8 with a float32 scale a row."""

    values: Bytes
    scale: npt.NDArray[np.float32]

    @classmethod
    def of(cls, vectors: Vectors) -> Eighths:
        scale = np.maximum(np.abs(vectors).max(axis=1), 1e-12) / _LEVELS
        return cls(np.round(vectors / scale[:, None]).astype(np.int8), scale.astype(np.float32))

    @property
    def bytes(self) -> int:
        return self.values.nbytes + self.scale.nbytes

    def scores(self, query: Vectors, rows: IntArray | None = None) -> npt.NDArray[np.float32]:
        """(r,) the products with a query (d,) of some rows, or of all."""
        values, scale = (self.values, self.scale) if rows is None else (self.values[rows], self.scale[rows])
        found: npt.NDArray[np.float32] = (values.astype(np.float32) @ query) * scale
        return found


@dataclass(frozen=True, eq=False)
class Bits:
    """Vectors (n, d) as their signs, 64 a word."""

    words: Words
    dim: int

    @classmethod
    def of(cls, vectors: Vectors) -> Bits:
        return cls(_packed(vectors), vectors.shape[1])

    @property
    def bytes(self) -> int:
        return self.words.nbytes

    def scores(self, query: Vectors) -> npt.NDArray[np.float32]:
        """(n,) in [-1, 1]: 1 - 2 × the share of signs that differ from the query's (d,)."""
        differ = np.bitwise_count(self.words ^ _packed(query[None])).sum(axis=1)
        return np.asarray(1 - 2 * differ / self.dim, np.float32)


def nearest(scores: npt.NDArray[np.float32], count: int) -> IntArray:
    """The rows of the `count` highest scores, best first, equal ones by row."""
    count = min(count, len(scores))
    some = np.argpartition(-scores, count - 1)[:count] if count < len(scores) else np.arange(len(scores))
    edge = scores[some].min()
    tied = np.flatnonzero(scores >= edge)  # all at the edge, so that ties do not depend on the partition
    return np.asarray(tied[np.lexsort((tied, -scores[tied]))][:count], np.int64)


def rescored(bits: Bits, eighths: Eighths, query: Vectors, pool: int, count: int) -> IntArray:
    """The best `count` rows by int8 among the `pool` nearest by bits."""
    some = np.sort(nearest(bits.scores(query), pool))
    return some[nearest(eighths.scores(query, some), count)]


def _packed(vectors: Vectors) -> Words:
    signs = np.packbits(vectors > 0, axis=1)
    pad = -signs.shape[1] % 8
    return np.ascontiguousarray(np.pad(signs, ((0, 0), (0, pad)))).view(np.uint64)
