"""Vectors of many texts, computed once and kept, so that a study that is killed does not embed them again."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from erag.core.text import content_hash
from erag.lm.adapter import AnyEmbedder
from erag.lm.roles import Vectors


class KeptVectors:
    """An embedder whose results lie in a folder, a file a call, named by the texts and by what computed them."""

    def __init__(self, embedder: AnyEmbedder, folder: Path) -> None:
        self._embedder, self._folder = embedder, folder

    def __call__(self, texts: Sequence[str]) -> Vectors:
        """(n, d) float32 unit rows, same order."""
        key = content_hash(self._embedder.fingerprint("embed"), *texts).hex()
        file = self._folder / f"{key}.npy"
        if file.is_file():
            known: Vectors = np.load(file, allow_pickle=False)
            return known
        found = self._embedder.embed(texts, "document")
        self._folder.mkdir(parents=True, exist_ok=True)
        fresh = self._folder / f".{key}.{os.getpid()}.npy"
        np.save(fresh, found, allow_pickle=False)
        fresh.replace(file)
        return found
