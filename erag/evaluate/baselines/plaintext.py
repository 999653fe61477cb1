"""Naive-RAG as the paper ran it, but for the language model: the map as plain text, chunks, context, the node named."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.text import clean
from erag.core.times import format_time
from erag.core.types import Observation, Pose, SensorWish, TopoMap
from erag.forest.evidence import tokens
from erag.lm.roles import Embedder
from erag.retrieve.corpus import map_texts
from erag.retrieve.scoring import best_first, similarity

CONTEXT = 16_000  # tokens (paper)
CHUNK = 240  # tokens: what the default embedder reads of a text (256, with some to spare)


@dataclass(frozen=True, slots=True)
class Chunk:
    """A part of the map's text: whole nodes, in the order of the map."""

    text: str
    nodes: tuple[str, ...]


def node_line(node: Observation, text: str) -> str:
    """A node as the paper's `.txt` has it: id, position, time, caption, readings."""
    at = ", ".join(f"{v:.10g}" for v in node.pose.xyz)
    time = f"; time {format_time(node.time)}" if node.time is not None else ""
    readings = "".join(f"; {clean(name)} {value:.4g}" for name, value in sorted(node.sensors.items()))
    return f"node {node.id}: position ({at}){time}{readings}; {text or 'no caption'}"


def chunks(topomap: TopoMap, size: int = CHUNK) -> list[Chunk]:
    """The map as text, cut between nodes into chunks of at most `size` tokens (a longer node is a chunk of its own).

    Raises ValueError for a size below 1.
    """
    if size < 1:
        raise ValueError(f"chunks of {size} tokens")
    made, lines, ids, held = list[Chunk](), list[str](), list[str](), 0
    for node, text in zip(topomap.nodes, map_texts(topomap), strict=True):
        line = node_line(node, text)
        if lines and held + tokens(line) > size:
            made.append(Chunk("\n".join(lines), tuple(ids)))
            lines, ids, held = [], [], 0
        lines.append(line)
        ids.append(node.id)
        held += tokens(line)
    return [*made, Chunk("\n".join(lines), tuple(ids))] if lines else made


def question(text: str, at: Pose | None = None, sensors: Mapping[str, SensorWish] | None = None) -> str:
    """The question with L and S put into words, as the baselines are given them (paper)."""
    said = [text.strip()] if text.strip() else []
    if at is not None:
        said.append(f"I am at position ({', '.join(f'{v:.10g}' for v in at.xyz)}); prefer what is near.")
    for name, wish in sorted((sensors or {}).items()):
        wanted = wish if isinstance(wish, str) else f"between {wish[0]:g} and {wish[1]:g}"
        said.append(f"Prefer places where {name} is {wanted}.")
    return " ".join(said)


class ChunkIndex:
    """Chunks by their vectors: the most similar to a question fill the context until the next would not fit."""

    def __init__(self, made: Sequence[Chunk], embedder: Embedder) -> None:
        self._chunks, self._embedder = tuple(made), embedder
        self._vectors = embedder.embed([c.text for c in self._chunks], "document") if self._chunks else None

    def context(self, asked: str, budget: int = CONTEXT) -> tuple[Chunk, ...]:
        """The chunks for a question, the most similar first, of at most `budget` tokens together."""
        if self._vectors is None:
            return ()
        scores = similarity(self._vectors, self._embedder.embed([asked], "query"))[0]
        order = best_first(scores, np.arange(len(scores)))
        costs = np.array([tokens(c.text) for c in self._chunks])[order]
        return tuple(self._chunks[i] for i in order[np.cumsum(costs) <= budget])


def named_node(answer: str, nodes: Sequence[str], known: frozenset[str]) -> str | None:
    """The node an answer names, None where it cannot be resolved (which counts 0).

    It is the first of `nodes`, those in the context, that the answer names as `node ID`; else the only one whose id
    stands in it as a word of its own; else the answer itself where it is an id of the map (`known`).
    """
    text = clean(answer)
    if text in known:
        return text
    ids = sorted(set(nodes), key=lambda n: (-len(n), n))
    stands = {n: re.search(rf"(?<![\w.-]){re.escape(n)}(?![\w-])(?!\.\d)", text) for n in ids}
    marked = {n: re.search(rf"\bnode\W{{0,5}}{re.escape(n)}(?![\w-])(?!\.\d)", text, re.IGNORECASE) for n in ids}
    first = sorted((m.start(), -len(n), n) for n, m in marked.items() if m)
    if first:
        return first[0][2]
    alone = [n for n, m in stands.items() if m]
    return alone[0] if len(alone) == 1 else None
