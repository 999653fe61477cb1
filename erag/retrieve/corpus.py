"""What retrieval searches: a map, its forest, the texts of the nodes and their vectors, held in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from erag.core.text import node_text, sentences
from erag.core.types import Forest, IntArray, TopoMap
from erag.lm.roles import Vectors
from erag.retrieve.lexical import LexicalIndex


def map_texts(topomap: TopoMap) -> tuple[str, ...]:
    """The text of each node (n): its caption, else its name as words, else the empty string."""
    return tuple(node_text(node.name, node.caption) for node in topomap.nodes)


def split_sentences(texts: Sequence[str]) -> tuple[tuple[str, ...], IntArray]:
    """All sentences of `texts` in order, (s,), and the row of the text each comes from, (s,) int64."""
    split = [sentences(text) for text in texts]
    rows = np.repeat(np.arange(len(texts), dtype=np.int64), [len(part) for part in split])
    return tuple(s for part in split for s in part), rows


@dataclass(frozen=True, eq=False)
class Corpus:
    """A searchable memory of n nodes, s sentences and c clusters.

    `node_vectors` (n, d), a zero row for a node without text; `sentence_vectors` (s, d) with `sentence_rows` (s,) int64
    ascending; `summary_vectors` (c, d), the embedded summaries of the forest's clusters, a zero row for none. The
    forest's leaves are the map's nodes in the same order.
    """

    topomap: TopoMap
    forest: Forest
    texts: tuple[str, ...]
    node_vectors: Vectors
    sentence_vectors: Vectors
    sentence_rows: IntArray
    summary_vectors: Vectors

    @cached_property
    def searchable(self) -> npt.NDArray[np.bool_]:
        """(n,) bool: nodes that have a text and so can be a hit of a query with text."""
        return np.array([bool(t) for t in self.texts], np.bool_)

    @cached_property
    def index(self) -> LexicalIndex:
        """Where each word stands in the texts."""
        return LexicalIndex(self.texts)

    @cached_property
    def visible(self) -> npt.NDArray[np.bool_]:
        """(n,) bool: nodes with a text or an image, which can be a hit of a query that only says where."""
        return self.searchable | np.array([node.image is not None for node in self.topomap.nodes], np.bool_)

    def quote(self, row: int, vector: Vectors) -> str:
        """The sentence of a node that comes closest to a query's vector (d,); its whole text where it has but one."""
        spoken = sentences(self.texts[row])
        first, last = np.searchsorted(self.sentence_rows, [row, row + 1])
        if not spoken or len(spoken) != last - first:
            return self.texts[row]
        return spoken[int((self.sentence_vectors[first:last] @ vector).argmax())]
