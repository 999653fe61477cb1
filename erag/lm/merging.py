"""A GGUF model with an adapter merged in, as files with manifests by which a store accepts them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from erag.lm.llamacpp.config import Format
from erag.lm.llamacpp.quantise import Source, keep_manifest, quantise, source_of, variants_store
from erag.lm.torchlm.lora import LoraFile, check_base, lora_file
from erag.lm.weights import Manifest, ModelStore
from erag.lm.weights.digest import replace_durably, sha256_of
from erag.lm.weights.fetch import need_space
from erag.lm.weights.manifest import ModelFile

WHOLE: Format = "f16"
_MAKER = "erag models merge"


def merged(
    adapter: Path, forms: Sequence[Format], store: ModelStore, folder: Path, *, threads: int = 1
) -> dict[Format, Manifest]:
    """The model with the adapter in each form, in the store of `folder`; what is there already is left as it is.

    The F16 file is written in any case, since the others are made of it (by llama.cpp, which they need). Raises
    ModelError for an adapter of other weights, for a model that cannot be merged, and when the disk has no room.
    """
    source = merge(adapter, store, folder)
    return {
        form: source.manifest if form == WHOLE else quantise(source, form, folder, threads=threads) for form in forms
    }


def merge(adapter: Path, store: ModelStore, folder: Path) -> Source:
    """The F16 file of the model with the adapter merged in, unless it is there already and made of the same two."""
    taught = lora_file(adapter)
    header, base = taught.header, source_of(store, taught.header.base)
    check_base(taught, base.manifest.fingerprint)
    made, name = variants_store(folder), f"{header.base}-{header.taught}"
    note = _note(base, taught)
    there = (folder / "manifests" / f"{name}.yaml").is_file() and made.state(name) in ("verified", "present")
    if there and made.manifest(name).note == note:
        return source_of(made, name)
    target = made.folder(name) / f"{name}.{WHOLE}.gguf"  # the mark says that its weights are whole
    need_space(made, 4 * base.path.stat().st_size)
    partial = target.with_suffix(f".{os.getpid()}.partial")
    partial.parent.mkdir(parents=True, exist_ok=True)
    try:
        _write(base.path, taught, partial)
        file = ModelFile(path=target.name, sha256=sha256_of(partial), bytes=partial.stat().st_size)
        replace_durably(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    title = f"{base.manifest.title.split(',')[0]} taught {header.taught}, F16"
    update = {"id": name, "title": title, "note": note, "presets": (), "ram_mb": None, "files": (file,), "sources": ()}
    keep_manifest(folder, base.manifest.model_copy(update=update), _MAKER)
    return source_of(variants_store(folder), name)


def _write(base: Path, adapter: LoraFile, target: Path) -> None:
    from erag.lm.torchlm.container import open_container
    from erag.lm.torchlm.export import write_gguf
    from erag.lm.torchlm.shape import shape_of
    from erag.lm.torchlm.weights import dequantised

    source = open_container(base)
    shape = shape_of(source)
    tensors = dequantised(source, shape, "float32", adapter.terms(shape))
    write_gguf(source, shape, tensors, target)


def _note(base: Source, adapter: LoraFile) -> str:
    header, weights = adapter.header, base.manifest.fingerprint
    again = "" if base.whole else " The base was quantised before the adapter was trained on it."
    return (
        f"{header.base}, sha256 {weights}, with the adapter of sha256 {adapter.sha256} merged in."
        f"{again} {header.taught_by}"
    ).strip()
