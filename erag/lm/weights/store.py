"""The store of model files: what is present, what is verified, and the path a backend may open."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from erag.core.errors import ModelError
from erag.lm.weights.digest import Stamp, sha256_of, write_durably
from erag.lm.weights.lock import hold
from erag.lm.weights.manifest import Manifest, ModelFile, load_manifests
from erag.lm.weights.progress import Progress, Silent

State = Literal["verified", "present", "partial", "missing", "wrong"]


class _Verified(BaseModel):
    """What was found when a model's files were hashed last: path -> (stamp, sha256)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    files: dict[str, tuple[Stamp, str]] = {}


@dataclass(frozen=True, slots=True)
class FileCheck:
    """One file against its manifest. `detail` says what is wrong with it."""

    path: str
    state: Literal["ok", "missing", "wrong"]
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Check:
    """All files of a model against the manifest, and what else lies in a model's folder."""

    id: str
    files: tuple[FileCheck, ...]
    foreign: tuple[str, ...] = ()

    @property
    def state(self) -> Literal["ok", "missing", "wrong"]:
        states = {file.state for file in self.files}
        if "wrong" in states or self.foreign:
            return "wrong"
        return "missing" if "missing" in states else "ok"

    @property
    def problems(self) -> str:
        """What is not right, in words; empty when all is."""
        bad = [f"{file.path} {file.detail}" for file in self.files if file.state != "ok"]
        return ", ".join(bad + [f"{name} is not in the manifest" for name in self.foreign])


class ModelStore:
    """Manifests, and the folder in which each model's files are under `<id>/`.

    `own` is a second folder of manifests, the user's; `quarantine` is where files go that fail their hash (default:
    beside `files`). Nothing is read or written at construction.
    """

    def __init__(
        self, manifests: Path, files: Path, *, own: Path | None = None, quarantine: Path | None = None
    ) -> None:
        self.manifests, self.files, self.own = manifests, files, own
        self.quarantine = quarantine or files.with_name("quarantine")

    @cached_property
    def _by_id(self) -> dict[str, Manifest]:
        return load_manifests(folder for folder in (self.manifests, self.own) if folder is not None)

    def all(self) -> tuple[Manifest, ...]:
        """All manifests, sorted by id. Raises ConfigError when one of them cannot be used."""
        return tuple(self._by_id.values())

    def manifest(self, model: str) -> Manifest:
        """The manifest of an id. Raises ModelError naming the ids there are."""
        if model not in self._by_id:
            raise ModelError(f"there is no model {model!r}", allowed=", ".join(self._by_id), repair="erag models list")
        return self._by_id[model]

    def fingerprint(self, model: str) -> str:
        """sha256 (hex) that stands for the model's weights; known from the manifest, the files may be absent."""
        return self.manifest(model).fingerprint

    def folder(self, model: str) -> Path:
        """Where a model's files are or would be."""
        return self.files / model

    def staging(self, model: str) -> Path:
        """Where a model's files are put together; left there when that is interrupted."""
        return self.files / f"{model}.partial"

    def lock(self, model: str) -> Path:
        """The lock file to hold while a model's files are changed."""
        return self.files / ".locks" / f"{model}.lock"

    def path(self, model: str) -> Path:
        """The verified file of a model, or the verified folder of a model of several files.

        Files are hashed when they are new or have changed (size, modification time, inode) since the last time.
        Raises ModelError when a file is missing or fails its hash, with the command that repairs it.
        """
        manifest = self.manifest(model)
        check = self.check(model)
        if check.state != "ok":
            raise ModelError(check.problems, where=f"model {model}", repair=_repair(manifest, check))
        return self.location(model)

    def location(self, model: str) -> Path:
        """What `path` returns, without looking whether it is there."""
        manifest = self.manifest(model)
        return self.folder(model) if manifest.is_folder else self.folder(model) / manifest.files[0].path

    def check(self, model: str, *, anew: bool = False, progress: Progress | None = None) -> Check:
        """Each file against the manifest; `anew` hashes also what has not changed since it was last verified."""
        manifest, show = self.manifest(model), progress or Silent()
        known = {} if anew else self._verified(model).files
        found: dict[str, tuple[Stamp, str]] = {}
        with disk_errors(model, self.files):
            checks = tuple(self._check_file(manifest, file, known, found, show) for file in manifest.files)
        if found != self._verified(model).files:
            self._remember(model, found)
        return Check(model, checks, self._foreign(manifest))

    def state(self, model: str) -> State:
        """What can be said of a model without hashing anything."""
        manifest = self.manifest(model)
        stamps = [_stamp(self.folder(model) / file.path) for file in manifest.files]
        if None in stamps:
            begun = any(stamps) or any(self.staging(model).glob("**/*.partial"))
            return "partial" if begun else "missing"
        sizes = zip(manifest.files, stamps, strict=True)
        if self._foreign(manifest) or any(f.bytes and s and f.bytes != s.size for f, s in sizes):
            return "wrong"
        known = self._verified(model).files
        same = all(known.get(f.path) == (s, f.sha256) for f, s in zip(manifest.files, stamps, strict=True))
        return "verified" if same else "present"

    def remember(self, model: str, file: ModelFile) -> None:
        """Note that a file was hashed while it was written, so that it need not be read again."""
        found = {**self._verified(model).files, file.path: (Stamp.of(self.folder(model) / file.path), file.sha256)}
        self._remember(model, found)

    def remove(self, model: str) -> int:
        """Remove the files of the manifest and what an interrupted pull left; other files stay. The bytes freed."""
        manifest = self.manifest(model)
        if not self.files.is_dir():
            return 0
        with hold(self.lock(model), model):
            paths = [self.folder(model) / file.path for file in manifest.files]
            left = [path for path in self.staging(model).rglob("*") if path.is_file()]
            freed = sum(path.lstat().st_size for path in (*paths, *left) if path.is_file() or path.is_symlink())
            for path in paths:
                path.unlink(missing_ok=True)
            if self.staging(model).is_dir():
                shutil.rmtree(self.staging(model))
            self._record(model).unlink(missing_ok=True)
            _remove_empty({path.parent for path in paths} | {self.folder(model)})
        return freed

    def _check_file(
        self,
        manifest: Manifest,
        file: ModelFile,
        known: dict[str, tuple[Stamp, str]],
        found: dict[str, tuple[Stamp, str]],
        show: Progress,
    ) -> FileCheck:
        path = self.folder(manifest.id) / file.path
        before = _stamp(path)
        if before is None:
            return FileCheck(file.path, "missing", "is missing")
        if known.get(file.path) == (before, file.sha256):
            found[file.path] = (before, file.sha256)
            return FileCheck(file.path, "ok")
        actual = sha256_of(path, lambda done: show.update(f"{manifest.id}: verifying", done, before.size))
        if actual != file.sha256:
            return FileCheck(file.path, "wrong", f"has the sha256 {actual}, expected {file.sha256}")
        if _stamp(path) == before:  # not written to while it was read
            found[file.path] = (before, actual)
        return FileCheck(file.path, "ok")

    def _foreign(self, manifest: Manifest) -> tuple[str, ...]:
        """Files in a model's folder that a library may load though no manifest vouches for them."""
        folder = self.folder(manifest.id)
        if not manifest.is_folder or not folder.is_dir():
            return ()
        listed = {file.path for file in manifest.files}
        paths = {path.relative_to(folder) for path in folder.rglob("*") if not path.is_dir()}
        seen = {path.as_posix() for path in paths if not any(part.startswith(".") for part in path.parts)}
        return tuple(sorted(seen - listed))

    def _record(self, model: str) -> Path:
        return self.files / ".verified" / f"{model}.json"

    def _verified(self, model: str) -> _Verified:
        try:
            return _Verified.model_validate_json(self._record(model).read_bytes())
        except (FileNotFoundError, ValidationError):  # an unreadable record only costs hashing once more
            return _Verified()

    def _remember(self, model: str, found: dict[str, tuple[Stamp, str]]) -> None:
        if self.files.is_dir() and os.access(self.files, os.W_OK):  # a store that is only read is hashed each time
            write_durably(self._record(model), _Verified(files=found).model_dump_json())


def default_store(files: Path | None = None) -> ModelStore:
    """The store of this installation: `models/` of a source checkout, else the user's data folder.

    `files` puts the model files (and the quarantine) elsewhere. The user's own manifests are read in both cases.
    """
    package = Path(__file__).resolve().parents[2]
    checkout = package.parent / "models"
    home = user_folder()
    in_checkout = checkout.is_dir() and (package.parent / "pyproject.toml").is_file()
    manifests, root = (checkout, checkout) if in_checkout else (package / "_models", home)
    if files is not None:
        return ModelStore(manifests, files, own=home / "manifests", quarantine=files / "quarantine")
    return ModelStore(manifests, root / "files", own=home / "manifests")


def user_folder() -> Path:
    """The user's folder for models: `manifests/`, and in an installed package also `files/` and `quarantine/`."""
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "erag" / "models"


@contextmanager
def disk_errors(model: str, folder: Path) -> Iterator[None]:
    """What the disk refuses inside the block, as a ModelError of one line."""
    try:
        yield
    except OSError as error:
        what = f"{error.strerror or error} ({error.filename or folder})"
        raise ModelError(what, where=f"model {model}", repair="free or allow it, then run the same command") from error


def _stamp(path: Path) -> Stamp | None:
    return Stamp.of(path) if path.is_file() else None


def _repair(manifest: Manifest, check: Check) -> str:
    if check.foreign:
        return "move these files out of the folder"
    return f"erag models pull {manifest.id}" if manifest.sources else f"erag models import FILE --name {manifest.id}"


def _remove_empty(folders: Iterable[Path]) -> None:
    for folder in sorted(folders, key=lambda path: len(path.parts), reverse=True):
        with suppress(OSError):  # not there, or not empty: it holds files that are not ours
            folder.rmdir()
