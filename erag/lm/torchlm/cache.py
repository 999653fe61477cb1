"""Keys and values of the tokens seen so far, in buffers that are used again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from erag.lm.torchlm.shape import Shape

if TYPE_CHECKING:
    import torch


class Buffers:
    """Memory for one cache, a piece a layer and one to spare; it grows to the largest cache asked for and is kept.

    Fresh pages cost more than the numbers written into them.
    """

    def __init__(self, shape: Shape, dtype: torch.dtype) -> None:
        self.shape, self.dtype = shape, dtype
        self._flat: list[torch.Tensor] = []

    def cache(self, rows: int, columns: int, room: int = 0) -> Cache:
        """An empty cache of `rows` sequences over `columns`, to be resized up to `room`.

        What these buffers held is lost.
        """
        import torch

        need = 2 * rows * self.shape.kv_heads * max(columns, room) * self.shape.head
        if not self._flat or self._flat[0].numel() < need:
            self._flat = []  # freed before the larger ones are made
            self._flat = [torch.empty(need, dtype=self.dtype) for _ in range(self.shape.layers + 1)]
        return Cache(self.shape, self._flat, rows, columns)


class Pool:
    """Buffers by level: a cache at one level is made from one at the level above, so that both live side by side."""

    def __init__(self, shape: Shape, dtype: torch.dtype) -> None:
        self._shape, self._dtype = shape, dtype
        self._levels: list[Buffers] = []

    def level(self, depth: int) -> Buffers:
        """The buffers of a level, 0 the topmost."""
        while len(self._levels) <= depth:
            self._levels.append(Buffers(self._shape, self._dtype))
        return self._levels[depth]


class Cache:
    """`rows` sequences over columns 0 … `width`.

    Sequences of unequal length leave holes: columns that hold no token of a row and are never looked at. All may
    continue one `trunk`, which is then kept once.
    """

    def __init__(self, shape: Shape, flat: Sequence[torch.Tensor], rows: int, columns: int) -> None:
        import torch

        self._shape, self._flat, self._spare = shape, list(flat[:-1]), flat[-1]
        self.rows, self.width, self.columns, self._made = rows, 0, columns, rows
        self.trunk: Cache | None = None
        self._finite = False  # whether the columns that are not in use hold numbers
        self.lengths = torch.zeros(rows, dtype=torch.long)  # tokens of each row
        self.hole = torch.ones(rows, columns, dtype=torch.bool)

    @property
    def readable(self) -> int:
        """The columns that may be read, in use or not: what is masked still gets multiplied by zero."""
        return self.columns if self._finite else self.width

    @property
    def copied(self) -> int:
        """The columns that a cache that follows this one has to copy: none where this one can be its trunk."""
        return 0 if self.rows == 1 and self.trunk is None and self.width == self.columns else self.width

    def layer(self, index: int) -> torch.Tensor:
        """Keys and values (2, rows, kv, columns, hd) of a layer."""
        return self._view(self._flat[index], self.columns)

    def holes(self, first: int = 0, last: int | None = None) -> torch.Tensor | None:
        """(rows, width) bool of the rows `first:last`, None where they have no holes."""
        hole = self.hole[first : self.rows if last is None else last, : self.width]
        return hole if bool(hole.any()) else None

    def advance(self, lengths: Sequence[int], width: int) -> None:
        """Note that `width` columns were written, of which the first `lengths` are tokens."""
        import torch

        counts = torch.tensor(lengths)
        self.hole[: self.rows, self.width : self.width + width] = torch.arange(width) >= counts[:, None]
        self.lengths[: self.rows] += counts
        self.width += width

    def clear(self, rows: slice, start: int, stop: int) -> None:
        """Make columns finite that will be holes."""
        if start < stop:
            for i in range(self._shape.layers):
                self.layer(i)[:, rows, :, start:stop] = 0

    def follow(self, source: Cache, rows: Sequence[int]) -> None:
        """Continue the given rows of another cache, which has to stay as it is.

        A source of one full row becomes the trunk; else the rows are copied, for which room is needed.
        """
        import torch

        index, width = torch.tensor(rows), source.width
        self.lengths[:] = source.lengths[index]
        if not source.copied:
            self.trunk = source
            return
        self.trunk = source.trunk
        for i in range(self._shape.layers):
            self.layer(i)[:, :, :, :width] = source.layer(i)[:, :, :, :width].index_select(1, index)
        self.hole[:, :width] = source.hole[index, :width]
        self.width = width

    def resize(self, columns: int) -> None:
        """Lay out anew for `columns`, those without tokens zero. A step over all columns then needs no copies."""
        import torch

        for i, flat in enumerate(self._flat):
            if self._spare.numel() < self._numbers(columns):
                self._spare = torch.empty(self._numbers(columns), dtype=flat.dtype)
            old, new = self._view(flat, self.columns), self._view(self._spare, columns)
            new[:, : self.rows, :, : self.width] = old[:, : self.rows, :, : self.width]
            new[:, : self.rows, :, self.width :] = 0
            self._flat[i], self._spare = self._spare, flat
        hole = torch.ones(self._made, columns, dtype=torch.bool)
        hole[:, : self.width] = self.hole[:, : self.width]
        self.hole, self.columns, self._finite = hole, columns, True

    def drop(self, row: int) -> None:
        """Remove a row: the last one takes its place."""
        self.rows -= 1
        if row == self.rows:
            return
        for i in range(self._shape.layers):
            pair = self.layer(i)
            pair[:, row, :, : self.width] = pair[:, self.rows, :, : self.width]
        self.lengths[row] = self.lengths[self.rows]
        self.hole[row] = self.hole[self.rows]

    def _view(self, flat: torch.Tensor, columns: int) -> torch.Tensor:
        size = (2, self._made, self._shape.kv_heads, columns, self._shape.head)
        return flat[: self._numbers(columns)].view(size)

    def _numbers(self, columns: int) -> int:
        return 2 * self._made * self._shape.kv_heads * columns * self._shape.head
