"""Model files by manifest: where they come from, what their sha256 is, and the store that holds them."""

from erag.lm.weights.manifest import Manifest
from erag.lm.weights.store import ModelStore, default_store

__all__ = ["Manifest", "ModelStore", "default_store"]
