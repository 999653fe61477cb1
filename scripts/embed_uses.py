"""Embed the lexicon of uses with MiniLM and keep the vectors in eight bits beside it.

python scripts/embed_uses.py      after every change of erag/retrieve/uses.yaml
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import erag.retrieve
from erag.lm.config import build_backend
from erag.lm.weights import default_store
from erag.pipeline.config import load_config
from erag.retrieve.uses import VECTORS, lexicon_texts, made_of, read_uses


def main() -> None:
    backend = build_backend(load_config("tiny").backend, default_store())
    texts = lexicon_texts(read_uses())
    vectors = backend.embed(texts, "document")
    scale = 127 / np.abs(vectors).max(axis=1, keepdims=True)
    small = np.rint(vectors * scale).astype(np.int8)
    restored = small / np.linalg.norm(small.astype(np.float64), axis=1, keepdims=True)
    out = Path(erag.retrieve.__file__).parent / VECTORS
    np.savez_compressed(out, key=made_of(texts, backend.identity("embed")), vectors=small)
    worst = float((restored * vectors).sum(1).min())
    print(f"{out}: {len(texts):,} vectors, {out.stat().st_size:,} bytes, least cosine to the originals {worst:.5f}")


if __name__ == "__main__":
    main()
