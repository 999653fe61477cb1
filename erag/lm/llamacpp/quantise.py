"""GGUF files in other formats, made by llama.cpp in a child process, with manifests by which a store accepts them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import yaml

from erag.core.errors import ModelError
from erag.lm.llamacpp.config import FILE_TYPES, Format
from erag.lm.llamacpp.process import ask, child_command
from erag.lm.weights import Manifest, ModelStore
from erag.lm.weights.digest import replace_durably, sha256_of, write_durably
from erag.lm.weights.fetch import need_space
from erag.lm.weights.manifest import ModelFile

FORMATS: tuple[Format, ...] = get_args(Format)
_WHOLE = ("f16", "bf16", "f32")
_SECONDS = 3600.0


@dataclass(frozen=True, slots=True)
class Source:
    """A GGUF model of a store; `whole`: its weights have not been quantised before."""

    manifest: Manifest
    path: Path
    whole: bool


def source_of(store: ModelStore, model: str) -> Source:
    """A verified GGUF model of one file. Raises ModelError for any other."""
    manifest = store.manifest(model)
    if manifest.kind != "gguf" or manifest.is_folder:
        raise ModelError("is no GGUF model of one file", where=f"model {model}", allowed="kind: gguf")
    path = store.path(model)
    return Source(manifest, path, any(f"{mark}." in path.name.lower() for mark in _WHOLE))


def variants_store(folder: Path) -> ModelStore:
    """The store of quantised files in a folder: `manifests/`, and `files/` with a folder a variant."""
    return ModelStore(folder / "manifests", folder / "files")


def variant_id(model: str, form: Format) -> str:
    """The id of a variant."""
    return f"{model}-{form.replace('_', '-')}"


def quantise(
    source: Source, form: Format, folder: Path, *, threads: int, seconds: float = _SECONDS, command: Sequence[str] = ()
) -> Manifest:
    """Make a variant with its manifest in `folder`, unless it is there already and made of the same source.

    Raises ModelError when llama.cpp cannot make it, or when the disk has no room.
    """
    store, name = variants_store(folder), variant_id(source.manifest.id, form)
    known = folder / "manifests" / f"{name}.yaml"
    if known.is_file():
        manifest = store.manifest(name)
        if manifest.note == _note(source) and store.state(name) in ("verified", "present"):
            return manifest
    target = store.folder(name) / f"{name}.gguf"
    need_space(store, 4 * source.path.stat().st_size if form == "f16" else 2 * source.path.stat().st_size)
    partial = target.with_suffix(f".{os.getpid()}.partial")
    partial.parent.mkdir(parents=True, exist_ok=True)
    try:
        _convert(source, form, partial, threads, seconds, command)
        manifest = _manifest(source, form, ModelFile(path=target.name, sha256=sha256_of(partial), bytes=_size(partial)))
        replace_durably(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    keep_manifest(folder, manifest, "erag quantise")
    return manifest


def discard(variant: str, folder: Path) -> None:
    """Delete a variant's file and its manifest."""
    shutil.rmtree(variants_store(folder).folder(variant))
    (folder / "manifests" / f"{variant}.yaml").unlink()


def keep_manifest(folder: Path, manifest: Manifest, maker: str) -> None:
    """Put a manifest into the store of a folder; `maker` is the command that made its files."""
    said = manifest.model_dump(mode="json", exclude_defaults=True)
    text = f"# made by {maker}\n{yaml.safe_dump(said, sort_keys=False, allow_unicode=True)}"
    write_durably(folder / "manifests" / f"{manifest.id}.yaml", text)


def _convert(source: Source, form: Format, target: Path, threads: int, seconds: float, command: Sequence[str]) -> None:
    request = {
        "do": "convert", "path": str(source.path), "target": str(target), "file_type": FILE_TYPES[form],
        "threads": threads,
    }  # fmt: skip
    outcome = ask(command or child_command(), request, seconds)
    if outcome.state != "ok":
        raise ModelError(
            f"no {form} of {source.manifest.id}: the child process {outcome.detail}", where=str(source.path)
        )


def _manifest(source: Source, form: Format, file: ModelFile) -> Manifest:
    made_of, old = source.manifest, source.manifest.title.split(",")[0]
    return made_of.model_copy(update={
        "id": variant_id(made_of.id, form), "title": f"{old}, {form.upper()}", "note": _note(source), "presets": (),
        "ram_mb": None, "files": (file,), "sources": (),
    })  # fmt: skip


def _note(source: Source) -> str:
    again = (
        "" if source.whole else " Quantised before, and quantised again here: a file made from whole weights is better."
    )
    return f"Made by llama.cpp from {source.manifest.id}, sha256 {source.manifest.fingerprint}.{again}"


def _size(path: Path) -> int:
    return path.stat().st_size
