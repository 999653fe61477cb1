"""One backend in one trial, in a process of its own: what it said, how long it took, how much memory it needed."""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from erag.bench.memory import peak_mb
from erag.compare.config import ROLE_OF, BackendSpec, CompareConfig
from erag.compare.cosine import Cosine
from erag.compare.trial import Trial
from erag.core.errors import EragError
from erag.core.output import replacing
from erag.core.text import content_hash
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_models
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
from erag.lm.offline import forbid_network
from erag.lm.roles import Embedder, LMBackend, RoleName, Roles
from erag.lm.weights import ModelStore, default_store

RULES = 1  # raised when the same configuration would be measured differently
_KEY = "asked"


@dataclass(frozen=True)
class Cell:
    """Outputs of a backend on the items of a trial, and what they took.

    `seconds` are those spent in the model for all items, loading (`load_seconds`, with the first item) apart; `base_mb`
    is the process before the model, `peak_mb` its largest resident size. With an `error` there are no outputs.
    """

    trial: str
    backend: str
    digest: str
    outputs: list[Any] = field(default_factory=list, repr=False)
    seconds: float = 0.0
    load_seconds: float = 0.0
    base_mb: float = 0.0
    peak_mb: float = 0.0
    tokens_in: int = 0
    tokens_out: int = 0
    cost: float = 0.0
    events: dict[str, int] = field(default_factory=dict)
    error: str = ""


@dataclass(frozen=True)
class Job:
    """What a process is to measure; everything in it can be sent to one."""

    trial: str
    backend: str
    config: CompareConfig
    items: list[Any]
    files: Path  # of the model store

    @property
    def role(self) -> RoleName:
        return ROLE_OF[self.config.trials[self.trial].kind]

    @property
    def spec(self) -> BackendSpec:
        return self.config.backends[self.backend]

    def digest(self, store: ModelStore) -> str:
        """Changes when anything does that determines the outputs or the measurement."""
        trial = self.config.trials[self.trial].model_dump(mode="json", exclude={"backends"})
        stated = {
            "rules": RULES, "trial": trial, "items": self.items, "threads": self.config.threads,
            "backend": self.spec.model_dump(mode="json"), "model": built(self.spec, self.role, store)[1],
        }  # fmt: skip
        return content_hash(json.dumps(stated, sort_keys=True, ensure_ascii=False)).hex()


def built(spec: BackendSpec, role: RoleName, store: ModelStore, ledger: Ledger | None = None) -> tuple[LMBackend, str]:
    """A backend for one role, nothing loaded yet, and its fingerprint. Raises ConfigError where it cannot play it."""
    models = build_models(BackendConfig(models={_KEY: spec.model}, roles={}), store, ledger)
    if spec.cosine:
        embedder = compose(models, Roles({"embed": _KEY}))
        models = {_KEY: Cosine(models[_KEY], cast(Embedder, embedder))}
    backend = compose(models, Roles({role: _KEY}))
    return backend, backend.fingerprint(role)


def measured(job: Job, folder: Path, store: ModelStore) -> tuple[Cell, bool]:
    """The cell of a job, and whether it was there already: from `folder` where nothing changed, else measured anew."""
    try:
        digest = job.digest(store)
    except EragError as error:
        return Cell(job.trial, job.backend, "", error=error.line()), False
    path = folder / f"{_plain(job.trial)}--{_plain(job.backend)}.json"
    kept = read_cell(path)
    if kept is not None and kept.digest == digest:
        return kept, True
    cell = _apart(job, digest)
    if not cell.error:
        with replacing(path) as file:
            json.dump(asdict(cell), file, ensure_ascii=False, indent=1)
    return cell, False


def read_cell(path: Path) -> Cell | None:
    """A kept cell; None where there is none that can be read."""
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
        return Cell(**raw)
    except (OSError, ValueError, TypeError):
        return None


def model_mb(model: BaseModel, store: ModelStore) -> float | None:
    """Size of the files of a model, None where it has none here."""
    known = {m.id for m in store.all()}
    sizes: list[int] = []
    for value in (getattr(model, name) for name in type(model).model_fields):
        if isinstance(value, str) and value in known:
            sizes.append(store.manifest(value).bytes or 0)
        elif isinstance(value, Path) and value.is_file():
            sizes.append(value.stat().st_size)
        elif isinstance(value, BaseModel):
            sizes.append(int((model_mb(value, store) or 0) * 1e6))
    total = sum(sizes)
    return total / 1e6 if total else None


def _apart(job: Job, digest: str) -> Cell:
    try:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            return pool.submit(_measure, job, digest).result()
    except BrokenProcessPool:
        return Cell(job.trial, job.backend, digest, error="its process died: out of memory, or a crash in native code")


def _measure(job: Job, digest: str) -> Cell:
    if job.config.threads is not None:
        os.environ["OMP_NUM_THREADS"] = str(job.config.threads)  # read by the numeric libraries, not imported yet
    forbid_network()
    try:
        return _asked(job, digest)
    except EragError as error:
        return Cell(job.trial, job.backend, digest, error=error.line())


def _asked(job: Job, digest: str) -> Cell:
    from erag.compare.trials import trial_of

    store = default_store(job.files)
    trial = trial_of(job.config, job.trial, store)
    ledger = Ledger()
    backend = Metered(built(job.spec, job.role, store, ledger)[0], ledger)
    base = peak_mb()
    _warm_up(trial, backend, job.items)
    before, loading = deepcopy(ledger), ledger.seconds[job.role]
    outputs = trial.ask(backend, job.items, ledger)
    return Cell(
        job.trial, job.backend, digest, outputs,
        seconds=ledger.seconds[job.role] - loading, load_seconds=loading, base_mb=base, peak_mb=peak_mb(),
        tokens_in=ledger.tokens_in[job.role] - before.tokens_in[job.role],
        tokens_out=ledger.tokens_out[job.role] - before.tokens_out[job.role],
        cost=sum(ledger.cost.values()) - sum(before.cost.values()), events=dict(ledger.events - before.events),
    )  # fmt: skip


def _warm_up(trial: Trial, backend: LMBackend, items: list[Any]) -> None:
    """Load the model, so that the seconds of the items are theirs alone."""
    if trial.role == "embed":
        backend.embed(["warm up"], "query")
    else:
        trial.ask(backend, items[:1], Ledger())


def _plain(name: str) -> str:
    """A name as part of a file's name; what is left out is told apart by a hash."""
    kept = "".join(c if c.isalnum() or c in "._-" else "-" for c in name)
    return kept if kept == name else f"{kept}-{content_hash(name).hex()[:6]}"
