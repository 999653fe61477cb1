"""Whether two names may be one thing though they are worded differently: by their words, and by their vectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from erag.aware.things import Name, alike
from erag.lm.roles import Vectors

CLOSE = 0.78  # cosine of two names from which on they may be worded differently for one thing


class Likeness:
    """Compares names by their words, then by the cosine of their vectors, which are made once, on first use."""

    def __init__(self, embed: Callable[[Sequence[str]], Vectors], close: float = CLOSE) -> None:
        self._embed, self._close = embed, close
        self._vectors: dict[Name, Vectors] = {}

    def __call__(self, one: Name, other: Name) -> bool:
        """Whether a view that names one may mean the other."""
        return alike(one, other) or float(self._vector(one) @ self._vector(other)) >= self._close

    def learn(self, names: Sequence[Name]) -> None:
        """Embed many names in one call."""
        new = [name for name in dict.fromkeys(names) if name not in self._vectors]
        if new:
            self._vectors.update(zip(new, self._embed([" ".join(n) for n in new]), strict=True))

    def _vector(self, name: Name) -> Vectors:
        self.learn([name])
        return np.asarray(self._vectors[name])
