"""What is computed together: batches, chunks and shared prefixes, each a function of the tokens alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

CHUNK_TOKENS = 1024  # of one pass through the network; its temporaries stay small enough to be used again
MIN_SHARED = 8  # tokens that a prefix has to save to be computed on its own

Tokens = tuple[int, ...]
Row = TypeVar("Row", Tokens, str)


@dataclass(frozen=True, slots=True)
class Limits:
    """How large a batch may be: rows, and rows times columns of the cache."""

    rows: int
    cells: int


def batches(widths: Sequence[int], limits: Limits) -> list[range]:
    """Consecutive items cut so that each batch keeps within `limits`; an item of its own may be wider."""
    cuts, start, widest = [], 0, 0
    for i, width in enumerate(widths):
        widest = max(widest, width)
        count = i - start + 1
        if count > 1 and (count > limits.rows or count * widest > limits.cells):
            cuts.append(range(start, i))
            start, widest = i, width
    return [*cuts, range(start, len(widths))] if widths else []


def chunks(lengths: Sequence[int]) -> Iterator[tuple[slice, int]]:
    """Consecutive rows that go through the network together, and the columns they are padded to."""
    for rows in batches(lengths, Limits(len(lengths), CHUNK_TOKENS)):
        yield slice(rows.start, rows.stop), max(lengths[rows.start : rows.stop])


def shared(one: Sequence[object], other: Sequence[object]) -> int:
    """How many tokens two sequences have in common at their beginning."""
    for i, (a, b) in enumerate(zip(one, other, strict=False)):
        if a != b:
            return i
    return min(len(one), len(other))


def common(rows: Sequence[Row]) -> int:
    """How many tokens (or characters) all sequences have in common at their beginning."""
    low, high = min(rows), max(rows)  # whatever these two share, all between them share
    return shared(low, high)


@dataclass(frozen=True)
class Branch:
    """Tokens `start` … `start + len(tokens)` of the sequences `members`, and what follows them."""

    start: int
    tokens: Tokens
    members: tuple[int, ...]
    children: tuple[Branch, ...] = field(default=())


def tree(rows: Sequence[Tokens], members: Sequence[int], start: int = 0) -> Branch:
    """The sequences `rows[members]`, which agree up to `start`, as a tree of their shared prefixes.

    `members` are in the order of their sequences. A prefix becomes a branch when it is at least MIN_SHARED tokens
    longer than the one before and belongs to more than one sequence; so equal prompts are computed once, whatever
    follows them.
    """
    end = common([rows[m] for m in members])
    groups: list[list[int]] = []
    for member in members:
        if len(rows[member]) == end:
            continue  # it ends here
        if groups and shared(rows[groups[-1][-1]], rows[member]) >= end + MIN_SHARED:
            groups[-1].append(member)
        else:
            groups.append([member])
    children = tuple(tree(rows, group, end) for group in groups)
    return Branch(start, tuple(rows[members[0]][start:end]), tuple(members), children)
