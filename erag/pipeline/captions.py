"""Images to captions at build: which images are looked at, what a captioner saw, which files cannot be used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from erag.core.errors import printable
from erag.core.progress import Progress
from erag.core.text import MAX_CAPTION, clean, content_hash
from erag.core.types import Observation
from erag.data.files import inside
from erag.lm.captioning import caption_batch
from erag.lm.images import BadImage, BadImages
from erag.lm.journal import Journal, image_hash
from erag.lm.roles import Caption
from erag.memory.file import MemoryFile
from erag.memory.generations import Seen, shown

SHOWN = 20  # bad images told one by one
BAD = "images without a caption"
_AGAIN = "put the folder back, or ingest the source from where it is now"


class CaptionsConfig(BaseModel):
    """Which images a build looks at.

    `missing`: those of nodes without a caption of their own. `all`: every image, and captions that the sources state
    are left aside, so that a memory rests on pixels alone. `none`: no image.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    look: Literal["missing", "all", "none"] = "missing"


@dataclass(frozen=True)
class Looked:
    """What came of the images: `seen` by node id, `bad` by the folder of their source, and `lines` for the report."""

    seen: Mapping[str, Seen] = field(default_factory=dict)
    bad: Mapping[Path, Sequence[BadImage]] = field(default_factory=dict)
    lines: tuple[str, ...] = ()

    @property
    def state(self) -> str:
        """A hash of all that was seen: another one means another map."""
        parts = (part for node, s in sorted(self.seen.items()) for part in (node, s.caption or "", *s.objects, "\n"))
        return content_hash(*parts).hex()

    def nodes(self, nodes: Sequence[Observation]) -> tuple[Observation, ...]:
        """The nodes with what was seen in their images."""
        return tuple(shown(node, self.seen) for node in nodes)


@dataclass(frozen=True, slots=True)
class _File:
    """The image of a node: the folder of its source, its path, and the file itself, links followed."""

    node: str
    key: tuple[str, str]  # origin, path from the source's folder
    root: Path
    stated: Path
    real: Path


def look(
    memory: MemoryFile, backend: Journal, config: CaptionsConfig, *, eyes: bool, progress: Progress
) -> Looked:  # fmt: skip
    """Caption the images that `config` asks for, behind the journal: what is recorded is neither read nor computed.

    `eyes` says whether a model plays the caption role. Raises ModelError when it cannot be loaded.
    """
    nodes = memory.observations.nodes()
    files = _files(memory, _wanted(nodes, config))
    aside = {n.id: Seen(None) for n in nodes if n.caption is not None} if config.look == "all" else {}
    if not eyes:
        return Looked(aside, lines=_blind(files, config))
    if not files:
        return Looked(aside)
    bad: dict[str, BadImage] = {}
    hashes = _hashes(memory, files, bad)
    captions = _captions(backend, [f for f in files if f.node in hashes], hashes, bad, progress)
    if bad:
        backend.ledger.events[BAD] += len(bad)
    seen = {node: _seen(caption) for node, caption in captions.items()}
    return Looked({**aside, **seen}, _by_root(files, bad), _lines(files, bad, captions))


def _seen(caption: Caption) -> Seen:
    """A caption as a memory keeps it: cleaned and bounded as a source's own, for it may quote the world."""
    return Seen(clean(caption.text)[:MAX_CAPTION] or None, tuple(filter(None, map(clean, caption.objects))))


def _wanted(nodes: Sequence[Observation], config: CaptionsConfig) -> list[Observation]:
    if config.look == "none":
        return []
    return [n for n in nodes if n.image is not None and (config.look == "all" or n.caption is None)]


def _files(memory: MemoryFile, nodes: Sequence[Observation]) -> list[_File]:
    roots = {name: root for name, (root, _, _) in memory.observations.sources().items()}
    origins = memory.observations.origins()
    found = []
    for node in nodes:
        root, image = roots[origins[node.id]], str(node.image)
        path = root / image
        real = path.resolve() if inside(root, path) else path  # a link inside the folder is read, no other
        found.append(_File(node.id, (origins[node.id], image), root, path, real))
    return found


def _hashes(memory: MemoryFile, files: Sequence[_File], bad: dict[str, BadImage]) -> dict[str, str]:
    """Node id -> content hash of its image: of the file, else as it was when the file was last there."""
    known = memory.observations.image_hashes()
    hashes: dict[str, str] = {}
    for file in files:
        try:
            hashes[file.node] = image_hash(file.real)
        except BadImages as error:
            if file.key in known and not file.real.exists():
                hashes[file.node] = known[file.key]
            else:
                bad[file.node] = BadImage(file.stated, error.bad[0].reason)
    fresh = {f.key: hashes[f.node] for f in files if f.node in hashes and known.get(f.key) != hashes[f.node]}
    if fresh:
        memory.observations.put_image_hashes(fresh)
    return hashes


def _captions(
    backend: Journal, files: Sequence[_File], hashes: Mapping[str, str], bad: dict[str, BadImage], progress: Progress
) -> dict[str, Caption]:
    """Node id -> caption; equal images are captioned once, in batches that depend on the content alone."""
    first = {hashes[f.node]: f for f in reversed(files)}
    order, size = sorted(first), backend.batch_size("caption")
    done: dict[str, Caption] = {}
    failed: dict[str, str] = {}
    progress("caption", 0, len(order))
    for start in range(0, len(order), size):
        batch = order[start : start + size]
        captioner = _Known(backend, {first[h].real: h for h in batch})
        result = caption_batch(captioner, list(captioner.hashes))
        done.update({captioner.hashes[path]: caption for path, caption in result.captions.items()})
        failed.update({captioner.hashes[image.path]: image.reason for image in result.bad})
        progress("caption", min(start + size, len(order)), len(order))
    bad.update({f.node: BadImage(f.stated, failed[hashes[f.node]]) for f in files if hashes[f.node] in failed})
    return {f.node: done[hashes[f.node]] for f in files if hashes[f.node] in done}


@dataclass(frozen=True)
class _Known:
    """A journal as the captioner of files whose content hashes are known."""

    backend: Journal
    hashes: Mapping[Path, str]

    def caption(self, images: Sequence[Path]) -> list[Caption]:
        return self.backend.caption(images, [self.hashes[path] for path in images])


def _by_root(files: Sequence[_File], bad: Mapping[str, BadImage]) -> dict[Path, list[BadImage]]:
    found: dict[Path, list[BadImage]] = {}
    for file in files:
        if file.node in bad:
            found.setdefault(file.root, []).append(bad[file.node])
    return found


def _lines(files: Sequence[_File], bad: Mapping[str, BadImage], captions: Mapping[str, Caption]) -> tuple[str, ...]:
    """How many images were captioned, and why others were not: a source that is gone in one line, others one by one."""
    gone: dict[str, list[_File]] = {}
    for file in files:
        if not file.root.is_dir():
            gone.setdefault(file.key[0], []).append(file)
    told = [_gone(origin, group, bad) for origin, group in gone.items()]
    wrong = [f for f in files if f.node in bad and f.key[0] not in gone]
    single = [f"  {printable(f.key[1])}: {printable(bad[f.node].reason)}" for f in wrong]
    more = [f"  and {len(single) - SHOWN} more"] if len(single) > SHOWN else []
    head = f"captions: {len(captions):,} of {len(files):,} images captioned"
    return (head, *told, *single[:SHOWN], *more)


def _gone(origin: str, files: Sequence[_File], bad: Mapping[str, BadImage]) -> str:
    lost = sum(f.node in bad for f in files)
    kept = f"{len(files) - lost:,} captions were read from records"
    return f"  the images of {printable(origin)} are gone: {kept}, {lost:,} nodes stay without one; {_AGAIN}"


def _blind(files: Sequence[_File], config: CaptionsConfig) -> tuple[str, ...]:
    if not files:
        return ()
    what = "images are asked for" if config.look == "all" else "images have no caption"
    return (f"captions: {len(files):,} {what}, and no model plays the role caption",)
