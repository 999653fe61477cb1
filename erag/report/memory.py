"""What a page shows of a memory file, read once."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erag.core.errors import MemoryFileError
from erag.core.types import Forest, TopoMap
from erag.memory.database import undamaged
from erag.memory.file import MemoryFile
from erag.pipeline.load import Built, load
from erag.report.pictures import ImageFile
from erag.retrieve.corpus import Corpus


@dataclass(frozen=True)
class Shown:
    """A built memory for a page: map and forest, image files by row, and the lines that say how it came about.

    `models` are the roles a model played in the build; `preset` is empty where a configuration file was used.
    """

    name: str
    topomap: TopoMap
    forest: Forest
    images: tuple[ImageFile, ...]
    sources: tuple[str, ...]
    notes: tuple[str, ...]
    lines: tuple[str, ...]
    models: Mapping[str, str]
    preset: str = ""


def read_shown(path: Path, loaded: Built | None = None, preset: str = "") -> Shown:
    """The built memory at `path`; `loaded` saves a second loading. Raises MemoryFileError when it was not built yet."""
    built = loaded or load(path)
    return shown_of(path, built.corpus, built.stale, preset)


def shown_of(path: Path, corpus: Corpus, stale: Sequence[str] = (), preset: str = "") -> Shown:
    """As `read_shown`, of a memory whose corpus is already loaded (`Asker.corpus`, with `Asker.notes` as `stale`)."""
    with undamaged(path), MemoryFile.reading(path) as memory:
        generation = memory.generations.load()
        if generation is None:
            raise MemoryFileError("has no forest yet", where=str(path), repair=f"erag build {path}")
        sources, origins = memory.observations.sources(), memory.observations.origins()
        return Shown(
            name=memory.path.stem,
            topomap=corpus.topomap,
            forest=corpus.forest,
            images=_images(corpus.topomap, {name: root for name, (root, _, _) in sources.items()}, origins),
            sources=tuple(sources),
            notes=(*stale, *(note for _, notes, _ in sources.values() for note in notes)),
            lines=generation.report,
            models=role_models(json.loads(generation.config).get("config", {}).get("backend", {})),
            preset=preset,
        )


def role_models(backend: Mapping[str, Any]) -> dict[str, str]:
    """Role -> name of the model that plays it, of a backend's configuration as plain values."""
    models = backend.get("models", {})
    roles = {role: models.get(key, {}) for role, key in backend.get("roles", {}).items()}
    return {role: str(model.get("model") or model.get("kind") or "") for role, model in sorted(roles.items())}


def _images(topomap: TopoMap, roots: Mapping[str, Path], origins: Mapping[str, str]) -> tuple[ImageFile, ...]:
    return tuple(
        ImageFile(row, roots[origins[node.id]], node.image)
        for row, node in enumerate(topomap.nodes)
        if node.image is not None and origins.get(node.id) in roots
    )
