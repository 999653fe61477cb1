"""From worlds to a student: features, training, thresholds, 8-bit checkpoint, figures on held-out worlds, card."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erag.core.errors import ConfigError, InputError
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm.config import BackendConfig, build_backend
from erag.lm.features import RULES, Maps
from erag.lm.offline import go_offline
from erag.lm.roles import LMBackend
from erag.lm.student_checkpoint import load, save
from erag.lm.student_words import StudentWords
from erag.lm.weights import ModelStore
from erag.study.augment import varied
from erag.study.cache import FeatureCache
from erag.study.card import write_card
from erag.study.config import DistilConfig
from erag.study.examples import Example, Words, divided, words_of
from erag.study.judging import Judged, judge_views, judge_words, searched
from erag.study.posing import render_studios, render_views
from erag.study.shown import Shown
from erag.study.targets import Targets, targets
from erag.study.thresholds import best_thresholds
from erag.study.worlds import read_worlds, render

if TYPE_CHECKING:
    from erag.lm.student_network import Seen, StudentNetwork

_NTH = 10  # every so many studios, or runs of so many neighbours, set the thresholds
_COMMON = 0.5
_ROWS = 64  # images a forward pass


@dataclass(frozen=True)
class Report:
    """What came of it: the checkpoint, its figures on the training and the held-out worlds, seconds by stage."""

    out: Path
    bytes: int
    trained_on: int
    figures: Mapping[str, Judged]
    seconds: Mapping[str, float]

    def table(self) -> Shown:
        """The figures for the terminal."""
        rows = [
            (name, str(j.quality.images), str(j.quality.precision), str(j.quality.recall), str(j.quality.f1),
             str(j.quality.place))
            for name, j in self.figures.items()
        ]  # fmt: skip
        return Shown(("worlds", "images", "precision", "recall", "F1", "place"), rows, ("images",))


class _Clock:
    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def stage(self, name: str) -> None:
        now = time.perf_counter()
        self.seconds[name], self._last = now - self._last, now


def distil(config: DistilConfig, store: ModelStore, progress: Progress = quiet) -> Report:
    """Train, calibrate and judge a student as configured, and write it with its card.

    Resumable: features are kept block by block, training epoch by epoch. Raises ConfigError where no world is left to
    train on, InputError for worlds that cannot be read.
    """
    go_offline()
    clock, backend = _Clock(), build_backend(config.backend, store)
    examples, held_out = _examples(config, progress)
    learnt, apart = divided(examples, _studios(config, progress), _NTH)
    words = words_of(learnt, config.least_share, config.fewest)
    if not words.objects:
        raise InputError(
            "no class is seen often enough to be learnt", where=str(config.worlds), repair="a lower fewest"
        )
    blank = _student_words(config, words, store, backend)
    clock.stage("read")
    cache = FeatureCache(config.work / "features", store, config.backbone)
    variants = [varied(replace(e, variant=v)) for v in range(1 + config.variants) for e in learnt]
    maps, truth = _inputs(config, variants, words, cache, backend, progress)
    clock.stage("features")
    network = _trained(config, blank, maps, truth, progress)
    del maps, truth
    clock.stage("train")
    judges = _inputs(config, apart, words, cache, backend, progress)
    save(config.out, _calibrated(blank, network, *judges), network.state_dict())
    clock.stage("calibrate")
    figures = {"training worlds": _judge(config, examples, cache, backend, progress)}
    if held_out:
        figures["held-out worlds"] = _judge(config, held_out, cache, backend, progress)
        figures |= _compared(config, held_out, words.objects, store)
    clock.stage("judge")
    report = Report(config.out, config.out.stat().st_size, len(learnt), figures, clock.seconds)
    write_card(config, words, report.trained_on, report.bytes, figures)
    _write_figures(config, report)
    return report


def _examples(config: DistilConfig, progress: Progress) -> tuple[list[Example], list[Example]]:
    """The examples to train on, and those of the held-out worlds; data sets that are missing are rendered."""
    overlap = sorted(set(config.train) & set(config.held_out))
    if overlap:
        raise ConfigError(f"worlds {overlap} are to be trained on and held out", where="train, held_out")
    examples = []
    for seed in config.seeds:
        folder = config.worlds / f"seed{seed}"
        read = _data_set(folder, config.train, seed, progress)
        examples += [e for name in config.train for e in read[name]]
    for seed in config.view_seeds:
        folder = config.worlds / f"views{seed}"
        render_views(folder, config.train, seed, config.views, progress)
        read = read_worlds(folder)
        examples += [e for name in config.train for e in read[name]]
    read = _data_set(config.worlds / f"held-out{config.seeds[0]}", config.held_out, config.seeds[0], progress)
    return examples, [e for name in config.held_out for e in read[name]]


def _studios(config: DistilConfig, progress: Progress) -> list[list[Example]]:
    """The examples of each studio."""
    seed, found = config.seeds[0], []
    for count, painted in ((config.studios, False), (config.painted, True)):
        folder = config.worlds / f"{'painted' if painted else 'studios'}{seed}"
        if count:
            render_studios(folder, count, seed, painted, progress)
            read = read_worlds(folder)
            found += [read[f"studio{number}"] for number in range(count)]
    return found


def _data_set(folder: Path, names: Sequence[str], seed: int, progress: Progress) -> Mapping[str, list[Example]]:
    if not all((folder / "truth" / f"{name}.jsonl").is_file() for name in names):
        render(folder, names, seed, progress)
    return read_worlds(folder) if names else {}


def _student_words(config: DistilConfig, words: Words, store: ModelStore, backend: LMBackend) -> StudentWords:
    return StudentWords(
        objects=words.objects, colours=words.colours, shapes=words.shapes, places=words.places, lights=words.lights,
        thresholds=(_COMMON,) * len(words.objects), dim=backend.embed(["a"], "document").shape[1], width=config.width,
        depth=config.depth, backbone=config.backbone, weights=store.fingerprint(config.backbone),
        embedder=backend.identity("embed"), rules=RULES,
    )  # fmt: skip


def _inputs(
    config: DistilConfig, examples: Sequence[Example], words: Words, cache: FeatureCache, backend: LMBackend,
    progress: Progress,
) -> tuple[Maps, Targets]:  # fmt: skip
    maps = cache.get(examples, progress)
    captions = sorted({e.caption for e in examples})
    known = dict(zip(captions, backend.embed(captions, "document"), strict=True))
    vectors = np.stack([known[e.caption] for e in examples])
    return maps, targets(examples, words, vectors, config.least_share)


def _trained(
    config: DistilConfig, words: StudentWords, maps: Maps, truth: Targets, progress: Progress
) -> StudentNetwork:
    """Trained under a folder named by everything the weights depend on, so that another run never resumes this one."""
    from erag.study.training import train

    said = content_hash(
        words.model_dump_json(), config.training.model_dump_json(exclude={"wandb"}), *_digests(maps, truth)
    )
    return train(words, config.training, maps, truth, config.work / f"run-{said.hex()[:12]}", progress)


def _digests(maps: Maps, truth: Targets) -> list[str]:
    """What the tensors hold, read where they lie: in double precision features alone would take 10 GB."""
    tensors = [maps.fine, maps.coarse, *vars(truth).values()]
    return [f"{tuple(t.shape)} {t.dtype} {blake2b(t.contiguous().numpy()).hexdigest()}" for t in tensors]


def _calibrated(words: StudentWords, network: StudentNetwork, maps: Maps, truth: Targets) -> StudentWords:
    """The words with the thresholds that suit examples which were not learnt."""
    chances = np.concatenate([seen.presence.sigmoid().numpy() for seen in _seen(network, maps)])
    best = best_thresholds(chances, truth.presence.numpy())
    return words.model_copy(update={"thresholds": tuple(round(float(t), 4) for t in best)})


def _seen(network: StudentNetwork, maps: Maps) -> Iterator[Seen]:
    """What the network sees in the images of `maps`, some at a time."""
    import torch

    for start in range(0, len(maps.fine), _ROWS):
        with torch.inference_mode():
            yield network.both_ways(*(part[start : start + _ROWS].float() for part in (maps.fine, maps.coarse)))


def _judge(
    config: DistilConfig, examples: Sequence[Example], cache: FeatureCache, backend: LMBackend, progress: Progress
) -> Judged:
    """How the 8-bit student as it was written does on `examples`."""
    from erag.lm.student import View, read_view

    words, network = load(config.out)
    views: list[View] = []
    vectors = []
    for seen in _seen(network, cache.get(examples, progress)):
        views += [read_view(words, seen, i) for i in range(len(seen.presence))]
        vectors.append(seen.vector.numpy())
    search = searched(np.concatenate(vectors), backend.embed([e.caption for e in examples], "document"))
    return judge_views(views, examples, words, config.least_share, config.resamples, search)


def _compared(
    config: DistilConfig, examples: Sequence[Example], names: Sequence[str], store: ModelStore
) -> dict[str, Judged]:
    """The figures of other captioners on `examples`: a place is right where the caption names it."""
    meant = {other: name for name, others in config.synonyms.items() for other in (name, *others)}
    figures = {}
    for title, model in config.compare.items():
        backend = build_backend(BackendConfig(models={"eyes": model}, roles={"caption": "eyes"}), store)
        captions = backend.caption([example.image for example in examples])
        said = [frozenset(meant.get(word, word) for word in caption.objects) for caption in captions]
        known = set(names).union(*(example.seen(config.least_share) for example in examples))
        pairs = zip(captions, examples, strict=True)
        places = [e.place if e.place in c.text.lower() else "" for c, e in pairs]
        kept = [frozenset(words & known) for words in said]
        figures[f"held-out worlds, {title}"] = judge_words(
            kept, places, examples, names, config.least_share, config.resamples
        )
    return figures


def _write_figures(config: DistilConfig, report: Report) -> None:
    figures = {name: asdict(judged) for name, judged in report.figures.items()}
    (config.work / "figures.json").write_text(json.dumps({"seconds": dict(report.seconds), **figures}, indent=1))
