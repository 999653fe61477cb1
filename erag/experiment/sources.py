"""What memories are made of: the environments of a data set with the captions and readings an experiment gives them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from erag.core.errors import InputError
from erag.core.progress import Progress
from erag.core.text import content_hash
from erag.core.types import Observation
from erag.data.reading import Reading
from erag.data.registry import read
from erag.data.writer import write_folder
from erag.evaluate.dataset import Dataset, Environment
from erag.evaluate.datasets.catalogue import load_dataset
from erag.experiment.config import DataConfig
from erag.lm.captioning import caption_all
from erag.lm.config import BackendConfig, build_backend
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile


@dataclass(frozen=True)
class Source:
    """An environment of the data set `data` and the observation folder made of it; `digest` is of its content."""

    data: str
    environment: Environment
    folder: Path
    digest: str
    notes: tuple[str, ...] = ()


def environments(name: str, config: DataConfig) -> Dataset:
    """The environments an experiment uses of a data set. Raises InputError where none is left."""
    found = load_dataset(config.dataset, config.root, config.queries)
    found = found if config.split is None else found.of_split(config.split)
    if not config.environments:
        return found
    missing = sorted(set(config.environments) - {e.name for e in found.environments})
    if missing:
        known = ", ".join(e.name for e in found.environments)
        raise InputError(f"no environment {missing[0]!r}", where=f"data.{name}", allowed=known)
    return replace(found, environments=tuple(e for e in found.environments if e.name in config.environments))


def prepared(
    data: str, config: DataConfig, environment: Environment, work: Path, store: ModelStore, progress: Progress
) -> Source:
    """The observation folder of an environment, made once for each content. Images are left out.

    Raises InputError for a source that cannot be read, and where every image of a captioner is broken.
    """
    reading = read(environment.source, environment.reader)
    kept = [o for o in reading.observations if config.objects or o.kind == "place"]
    if not kept:
        raise InputError("no place nodes", where=f"data.{data}: {environment.name}", repair="objects: true")
    captions, notes = _captions(config, environment, reading.root, kept, work, store, progress)
    made = tuple(_given(o, captions, config) for o in kept)
    ids = {o.id for o in made}
    edges = tuple(e for e in reading.edges if e.a in ids and e.b in ids)
    clusters = reading.clusters if config.forest == "given" else ()
    sensors = dict(reading.sensors) if config.readings else {}
    out = replace(reading, observations=made, edges=edges, clusters=clusters, sensors=sensors, issues=())
    digest = _digest(out)
    folder = work / "sources" / f"{environment.name}-{digest[:12]}"
    if not folder.is_dir():
        write_folder(folder, out)
    return Source(data, environment, folder, digest, notes)


def _given(observation: Observation, captions: Mapping[str, str] | None, config: DataConfig) -> Observation:
    caption = observation.caption if captions is None else captions.get(observation.id)
    sensors = observation.sensors if config.readings else {}
    return replace(observation, caption=caption, image=None, sensors=dict(sensors))


def _captions(
    config: DataConfig,
    environment: Environment,
    root: Path,
    nodes: list[Observation],
    work: Path,
    store: ModelStore,
    progress: Progress,
) -> tuple[dict[str, str] | None, tuple[str, ...]]:
    """Captions by node id, None for those of the source; and what could not be captioned."""
    if config.captions == "given":
        return None, ()
    if config.captions == "truth":
        return {o.id: environment.truths.of(o.id).caption for o in nodes}, ()
    work.mkdir(parents=True, exist_ok=True)
    backend = build_backend(BackendConfig(models={"eyes": config.captions}, roles={"caption": "eyes"}), store)
    images = {o.id: root / o.image for o in nodes if o.image is not None}
    with MemoryFile.writing(work / "captions.erag", "erag run", create=True) as memory:
        done = caption_all(Journal(backend, memory.calls, Ledger(), progress), list(images.values()))
    if images and not done.captions:
        raise InputError(done.bad[0].reason if done.bad else "no image", where=str(environment.source))
    said = {node: done.captions[path].text for node, path in images.items() if path in done.captions}
    notes = (f"{environment.name}: {len(done.bad)} images without a caption",) if done.bad else ()
    return said, notes


def _digest(reading: Reading) -> str:
    """Of everything a memory is built from."""
    parts = [reading.frame.value, repr(sorted(reading.sensors.items()))]
    parts += [repr(replace(o, sensors=dict(sorted(o.sensors.items())))) for o in reading.observations]
    parts += [repr(e) for e in reading.edges] + [repr(c) for c in reading.clusters]
    return content_hash(*parts).hex()
