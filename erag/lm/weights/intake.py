"""Taking in a model that is already on this machine, recognised by its sha256: a file, or a folder of files."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from erag.core.errors import InputError, ModelError
from erag.lm.weights.digest import BLOCK, Partial, replace_durably, sha256_of
from erag.lm.weights.fetch import finish, need_space
from erag.lm.weights.lock import hold
from erag.lm.weights.manifest import Manifest, ModelFile
from erag.lm.weights.progress import Progress, Silent
from erag.lm.weights.store import ModelStore, disk_errors

How = Literal["present", "linked", "copied"]


@dataclass(frozen=True, slots=True)
class TakenIn:
    """A model that is now present and verified: linked to the file it came from, copied, or there before."""

    id: str
    path: Path
    how: How


def take_in(store: ModelStore, source: Path, name: str | None = None, progress: Progress | None = None) -> TakenIn:
    """Put a file or folder into the store under the manifest that its sha256 names (`name`: only that one).

    A file on the store's own disk is hard-linked, else copied. Raises InputError when nothing is at `source`, and
    ModelError when no manifest knows it.
    """
    show = progress or Silent()
    if source.is_dir():
        manifest = _known_folder(store, source, name, show)
    elif source.is_file():
        manifest = _known_file(store, source, name, show)
    else:
        raise InputError("no file or folder is there", where=str(source))
    with disk_errors(manifest.id, store.files), hold(store.lock(manifest.id), manifest.id):
        if store.check(manifest.id, progress=show).state == "ok":
            return TakenIn(manifest.id, store.path(manifest.id), "present")
        hows = {
            _place(store, manifest, file, source / file.path if manifest.is_folder else source, show)
            for file in manifest.files
        }
        shutil.rmtree(store.staging(manifest.id))
        return TakenIn(manifest.id, store.path(manifest.id), "copied" if "copied" in hows else "linked")


def _known_file(store: ModelStore, source: Path, name: str | None, show: Progress) -> Manifest:
    sha256 = _hashed(source, show)
    if name is not None:
        manifest = store.manifest(name)
        if manifest.is_folder:
            raise ModelError(
                f"{name} is a folder of {len(manifest.files)} files",
                where=str(source),
                repair=f"erag models import FOLDER --name {name}",
            )
        if manifest.files[0].sha256 != sha256:
            raise ModelError(f"its sha256 is {sha256}, that of {name} is {manifest.files[0].sha256}", where=str(source))
        return manifest
    for manifest in store.all():
        if any(file.sha256 == sha256 for file in manifest.files):
            if manifest.is_folder:
                raise ModelError(
                    f"this is one of {len(manifest.files)} files of {manifest.id}",
                    where=str(source),
                    repair="erag models import FOLDER",
                )
            return manifest
    raise _unknown(store, source, f"its sha256 {sha256} ({source.stat().st_size} bytes) is in no manifest")


def _known_folder(store: ModelStore, source: Path, name: str | None, show: Progress) -> Manifest:
    manifests = [store.manifest(name)] if name is not None else [m for m in store.all() if m.is_folder]
    wrong = []
    for manifest in manifests:
        reason = _difference(manifest, source, show)
        if reason is None:
            return manifest
        wrong.append(f"not {manifest.id}: {reason}")
    raise _unknown(store, source, "; ".join(wrong) or "no manifest is of a folder")


def _difference(manifest: Manifest, source: Path, show: Progress) -> str | None:
    """The first way in which a folder is not this model; None when it is."""
    if not manifest.is_folder:
        return "that is a single file, give its path"
    for file in manifest.files:
        if not (source / file.path).is_file():
            return f"{file.path} is missing"
    for file in manifest.files:
        actual = _hashed(source / file.path, show)
        if actual != file.sha256:
            return f"{file.path} has the sha256 {actual}, expected {file.sha256}"
    return None


def _hashed(path: Path, show: Progress) -> str:
    size = path.stat().st_size
    return sha256_of(path, lambda done: show.update("hashing", done, size))


def _unknown(store: ModelStore, source: Path, what: str) -> ModelError:
    where = store.own or store.manifests
    return ModelError(
        what,
        where=str(source),
        allowed=", ".join(m.id for m in store.all()),
        repair=f"for a model of your own write a manifest in {where} (docs/models.md has one to copy)",
    )


def _place(store: ModelStore, manifest: Manifest, file: ModelFile, source: Path, show: Progress) -> How:
    partial = store.staging(manifest.id) / f"{file.path}.partial"
    partial.parent.mkdir(parents=True, exist_ok=True)
    partial.unlink(missing_ok=True)
    try:
        os.link(source.resolve(), partial)
    except OSError:  # another disk, or one without links; a copy takes what room it takes and is reported as one
        _copy(store, manifest, file, source, show)
        return "copied"
    replace_durably(partial, store.folder(manifest.id) / file.path)
    return "linked"


def _copy(store: ModelStore, manifest: Manifest, file: ModelFile, source: Path, show: Progress) -> None:
    need_space(store, source.stat().st_size)
    with source.open("rb") as stream, Partial(store.staging(manifest.id) / f"{file.path}.partial") as out:
        while block := stream.read(BLOCK):
            out.write(block)
            show.update(f"{manifest.id}: copying", out.size, file.bytes)
        finish(store, manifest, file, out)
