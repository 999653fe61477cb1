"""Vectors in fewer bytes: float16, int8 and bits, with and without rescoring, and what is nearest by them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray
from erag.lm.roles import Vectors

VectorForm = Literal["float32", "float16", "int8", "bits", "rescored"]
Bytes = npt.NDArray[np.int8]
Words = npt.NDArray[np.uint64]
POOL = 100  # of the nearest by bits, scored anew
_LEVELS = 127


class Kept(Protocol):
    """Vectors (n, d) as they are kept."""

    @property
    def bytes(self) -> int: ...

    def nearest(self, query: Vectors, count: int) -> IntArray:
        """The rows nearest to a query (d,), best first, equal ones by row."""
        ...


def kept(vectors: Vectors, form: VectorForm, pool: int = POOL) -> Kept:
    """Unit vectors (n, d) in a form; `rescored`: of the `pool` nearest by bits the best by int8."""
    match form:
        case "float32":
            return Floats(vectors)
        case "float16":
            return Floats(vectors.astype(np.float16))
        case "int8":
            return Eighths.of(vectors)
        case "bits":
            return Bits.of(vectors)
        case "rescored":
            return Rescored(Bits.of(vectors), Eighths.of(vectors), pool)


@dataclass(frozen=True, eq=False)
class Floats:
    """Vectors (n, d) as floats of any width; products are made in single precision."""

    values: npt.NDArray[np.floating]

    @property
    def bytes(self) -> int:
        return self.values.nbytes

    def nearest(self, query: Vectors, count: int) -> IntArray:
        return nearest(self.values.astype(np.float32, copy=False) @ query, count)


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

    def nearest(self, query: Vectors, count: int) -> IntArray:
        return nearest(self.scores(query), count)


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

    def nearest(self, query: Vectors, count: int) -> IntArray:
        return nearest(self.scores(query), count)


@dataclass(frozen=True, eq=False)
class Rescored:
    """Bits, and int8 by which the `pool` nearest by bits are scored anew."""

    bits: Bits
    eighths: Eighths
    pool: int

    @property
    def bytes(self) -> int:
        return self.bits.bytes + self.eighths.bytes

    def nearest(self, query: Vectors, count: int) -> IntArray:
        some = np.sort(self.bits.nearest(query, self.pool))
        return some[nearest(self.eighths.scores(query, some), count)]


def nearest(scores: npt.NDArray[np.float32], count: int) -> IntArray:
    """The rows of the `count` highest scores, best first, equal ones by row."""
    count = min(count, len(scores))
    some = np.argpartition(-scores, count - 1)[:count] if count < len(scores) else np.arange(len(scores))
    edge = scores[some].min()
    tied = np.flatnonzero(scores >= edge)  # all at the edge, so that ties do not depend on the partition
    return np.asarray(tied[np.lexsort((tied, -scores[tied]))][:count], np.int64)


def _packed(vectors: Vectors) -> Words:
    signs = np.packbits(vectors > 0, axis=1)
    pad = -signs.shape[1] % 8
    return np.ascontiguousarray(np.pad(signs, ((0, 0), (0, pad)))).view(np.uint64)
