"""The forest as a flat series of steps, so that a page of any depth is written without recursion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from erag.core.text import clean, node_text
from erag.core.types import NO_PARENT, Cluster, Forest, IntArray, Observation, TopoMap
from erag.report.chart import hue_of

LEAF_TEXT = 90  # characters of a node's text in the tree


@dataclass(frozen=True, slots=True)
class Step:
    """`open` and `close` a cluster, or a `leaf`. `number` is the cluster's place, or the leaf's row."""

    kind: Literal["open", "close", "leaf"]
    number: int = 0
    id: str = ""
    title: str = ""
    level: int = 0
    hue: int | None = None
    views: int = 0
    mean_distance: float = 0.0
    summary: str = ""
    relationships: tuple[str, ...] = ()
    sensors: tuple[tuple[str, float], ...] = ()
    is_root: bool = False


def steps(forest: Forest, topomap: TopoMap) -> Iterator[Step]:
    """The forest from its roots down, the larger branch first; every cluster is opened and closed."""
    views = leaf_counts(forest)
    stack: list[int | Step] = [*_ordered(forest.roots, views)]
    while stack:
        item = stack.pop()
        if isinstance(item, Step):
            yield item
        elif item < forest.n_leaves:
            yield _leaf(item, topomap.nodes[item])
        else:
            yield _opened(forest, item, views[item])
            stack.append(Step("close"))
            stack.extend(_ordered(forest.children[item], views))


def leaf_counts(forest: Forest) -> list[int]:
    """How many base nodes lie at or below each of the m rows; parents stand on a level above their children's."""
    count = [1] * forest.n_leaves + [0] * len(forest.clusters)
    for row in sorted(range(len(count)), key=lambda r: int(forest.level[r])):
        if (above := int(forest.parent[row])) != NO_PARENT:
            count[above] += count[row]
    return count


def title_of(cluster: Cluster) -> str:
    """A cluster's name, else its id."""
    return clean(cluster.name) or cluster.id


def _ordered(rows: IntArray, views: list[int]) -> list[int]:
    """Rows as a stack gives them back: clusters by size, then leaves in their order."""
    return sorted((int(r) for r in rows), key=lambda r: (views[r], -r))


def _leaf(row: int, node: Observation) -> Step:
    name, text = clean(node.name or ""), node_text(None, node.caption)
    said = text if len(text) <= LEAF_TEXT else f"{text[: LEAF_TEXT - 1]}…"
    return Step("leaf", row, node.id, name if name != node.id else "", summary=said)


def _opened(forest: Forest, row: int, views: int) -> Step:
    number = row - forest.n_leaves
    cluster = forest.clusters[number]
    return Step(
        "open",
        number,
        cluster.id,
        title_of(cluster),
        cluster.level,
        hue_of(number),
        views,
        cluster.mean_distance,
        clean(cluster.summary),
        tuple(map(clean, cluster.relationships)),
        tuple(sorted(cluster.sensors.items())),
        bool(forest.parent[row] == NO_PARENT),
    )
