"""Features of many images, computed once and kept; a run that is killed goes on with the next block."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm.efficientnet import EfficientNetLite0, load_network
from erag.lm.features import COARSE, COLUMNS, FINE, ROWS, RULES, Maps, features, shrunk
from erag.lm.images import load
from erag.lm.weights import ModelStore
from erag.study.augment import look, seen_through
from erag.study.examples import Example

if TYPE_CHECKING:
    import torch

_BLOCK = 32  # images of a file


class FeatureCache:
    """Blocks of features as float16 safetensors files, named by the images' bytes, the weights and the rules."""

    def __init__(self, folder: Path, store: ModelStore, backbone: str) -> None:
        self._folder, self._store, self._backbone = folder, store, backbone
        self._network: EfficientNetLite0 | None = None

    def get(self, examples: Sequence[Example], progress: Progress = quiet) -> Maps:
        """Features (float16) of all examples, same order. Raises BadImages for an image that cannot be used."""
        import torch

        count = len(examples)
        fine = torch.empty(count, FINE, ROWS, COLUMNS, dtype=torch.float16)
        coarse = torch.empty(count, COARSE, ROWS // 2, COLUMNS // 2, dtype=torch.float16)
        for start in range(0, count, _BLOCK):
            progress("features", start, count)
            block = self._block(examples[start : start + _BLOCK])
            fine[start : start + _BLOCK], coarse[start : start + _BLOCK] = block["fine"], block["coarse"]
        progress("features", count, count)
        return Maps(fine, coarse)

    def _block(self, examples: Sequence[Example]) -> dict[str, torch.Tensor]:
        from safetensors.torch import load_file, save_file

        contents = [f"{hashlib.sha256(e.image.read_bytes()).hexdigest()} {look(e)}" for e in examples]
        key = content_hash(self._store.fingerprint(self._backbone), str(RULES), *contents).hex()
        file = self._folder / f"{key}.safetensors"
        if file.is_file():
            return load_file(file)
        maps = features(self._open(), [seen_through(shrunk(load(e.image).pixels), look(e)) for e in examples])
        block = {"fine": maps.fine.half(), "coarse": maps.coarse.half()}
        self._folder.mkdir(parents=True, exist_ok=True)
        fresh = file.with_suffix(f".{os.getpid()}")
        save_file(block, fresh)
        fresh.replace(file)
        return block

    def _open(self) -> EfficientNetLite0:
        if self._network is None:
            self._network = load_network(self._store.path(self._backbone))
        return self._network
