"""Captioners compared on the same images: captions against reference captions, objects and places against the truth."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from erag.bench.config import CaptionsBench
from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.data.registry import read
from erag.evaluate.naming import Naming, counted, naming, universe
from erag.evaluate.statistics import Interval, bootstrap
from erag.evaluate.text import Golden, SemanticSimilarity, TextScore
from erag.lm.captioning import Captioned, caption_all
from erag.lm.config import BackendConfig, build_backend
from erag.lm.images import BadImage
from erag.lm.roles import Caption, LMBackend
from erag.lm.weights import ModelStore
from erag.sim.truth import View, read_truth

QUESTION = "What can be seen here?"
NONE = Caption("")


@dataclass(frozen=True, slots=True)
class Example:
    """An image with its reference caption; `truth` is what a simulator knows to be in it."""

    node: str
    image: Path
    reference: str
    truth: View | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """One image: what was said, what the reference says, and SS with its control."""

    node: str
    said: str
    reference: str
    ss: float
    generic: float


@dataclass(frozen=True)
class CaptionScore:
    """A captioner on n images, means with 95 % intervals over images.

    `ss` is the cosine to the image's own reference, `generic` that of a sentence that fits everywhere, `others` that of
    the captions to the references of other images: where `ss` is no higher, the captions do not tell images apart.
    `coverage` is the share of the reference's things that the caption names. `rate` in images a second, without
    loading. `objects` only where there is a ground truth. `worst` are the images with the lowest SS; an image without a
    caption (`bad`) counts as SS 0.
    """

    captioner: str
    images: int
    ss: Interval
    generic: Interval
    others: Interval
    coverage: Interval
    rate: float
    bad: tuple[BadImage, ...]
    objects: Naming | None
    worst: tuple[Case, ...]


def run(
    config: CaptionsBench,
    store: ModelStore,
    progress: Progress = quiet,
    captioners: Mapping[str, LMBackend] | None = None,
) -> Iterator[CaptionScore]:
    """One score a captioner, in the order of the configuration, all on the same images and within one process.

    `captioners` replaces those of the configuration.
    """
    examples = list(_examples(config))
    embedder = build_backend(BackendConfig(models={"e": config.embedder}, roles={"embed": "e"}), store)
    similarity = SemanticSimilarity("embedder", embedder)
    configured = {
        name: build_backend(BackendConfig(models={"eyes": model}, roles={"caption": "eyes"}), store)
        for name, model in config.captioners.items()
    }
    for name, backend in (captioners or configured).items():
        done, seconds = _captioned(name, backend, examples, progress)
        yield _score(config, name, examples, done, seconds, similarity)


def _examples(config: CaptionsBench) -> Iterator[Example]:
    """The images that have a reference: the source's own caption, else that of the ground truth."""
    reading = read(config.source, config.reader)
    truth = {view.node: view for path in config.truth for view in read_truth(path)}
    found = 0
    for node in reading.observations:
        seen = truth.get(node.id)
        reference = node.caption or (seen.caption if seen else "")
        if node.image is not None and reference.strip():
            found += 1
            yield Example(node.id, reading.root / node.image, reference, seen)
    if not found:
        allowed = "observations with an image and a caption, or `truth` with captions"
        raise InputError("no image has a reference caption", where=str(config.source), allowed=allowed)


def _captioned(
    name: str, backend: LMBackend, examples: Sequence[Example], progress: Progress
) -> tuple[Captioned, float]:
    """All captions, and the seconds they took once the captioner was loaded (its first image is done twice)."""
    caption_all(backend, [examples[0].image])
    images = [example.image for example in examples]
    captions: dict[Path, Caption] = {}
    bad: list[BadImage] = []
    size = backend.batch_size("caption")
    start = time.perf_counter()
    for at in range(0, len(images), size):
        progress(name, at, len(images))
        done = caption_all(backend, images[at : at + size])
        captions |= done.captions
        bad += done.bad
    progress(name, len(images), len(images))
    return Captioned(captions, tuple(bad)), time.perf_counter() - start


def _score(
    config: CaptionsBench, name: str, examples: Sequence[Example], done: Captioned, seconds: float,
    similarity: SemanticSimilarity,
) -> CaptionScore:  # fmt: skip
    captions = [done.captions.get(example.image, NONE) for example in examples]
    texts, golden = [c.text for c in captions], [Golden(e.reference) for e in examples]
    far = len(golden) // 2  # an image half the drive away
    scores, others = (
        similarity.scores([QUESTION] * len(texts), texts, wanted) for wanted in (golden, golden[far:] + golden[:far])
    )
    return CaptionScore(
        name, len(examples), _mean(config, [s.ss for s in scores]), _mean(config, [s.generic for s in scores]),
        _mean(config, [s.ss for s in others]), _mean(config, [s.coverage for s in scores]), len(examples) / seconds,
        done.bad, _objects(config, examples, captions), _worst(config, examples, texts, scores),
    )  # fmt: skip


def _mean(config: CaptionsBench, values: Sequence[float]) -> Interval:
    return bootstrap(values, samples=config.samples, seed=config.seed)


def _objects(config: CaptionsBench, examples: Sequence[Example], captions: Sequence[Caption]) -> Naming | None:
    """Objects and places against the truth: a place is right where the caption names it."""
    pairs = [(e.truth, c) for e, c in zip(examples, captions, strict=True) if e.truth is not None]
    if not pairs:
        return None
    meant = _meant(config.synonyms)
    truth = [frozenset(o.name for o in view.objects if o.share >= config.least_share) for view, _ in pairs]
    said = [frozenset(meant.get(word, word) for word in caption.objects) for _, caption in pairs]
    classes = universe((), truth)
    right = [view.place in caption.text.lower() for view, caption in pairs]
    return naming(counted(said, truth, classes), right, classes, config.samples, config.seed)


def _meant(synonyms: Mapping[str, Sequence[str]]) -> dict[str, str]:
    return {word: name for name, words in synonyms.items() for word in (name, *words)}


def _worst(
    config: CaptionsBench, examples: Sequence[Example], texts: Sequence[str], scores: Sequence[TextScore]
) -> tuple[Case, ...]:
    rows = sorted(range(len(examples)), key=lambda i: (scores[i].ss, examples[i].node))[: config.worst]
    return tuple(Case(examples[i].node, texts[i], examples[i].reference, scores[i].ss, scores[i].generic) for i in rows)
