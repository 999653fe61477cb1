"""Trials of captioners: objects on simulated worlds, and likeness to a cloud model's captions of real frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from erag.compare.config import CaptionsTrial, ObjectsTrial, WorldsConfig
from erag.compare.reference import cloud_caption
from erag.compare.trial import Asked, Judgement, Outputs, RoleTrial, drawn, each, shifted
from erag.core.text import words
from erag.data.registry import read
from erag.evaluate.naming import counted, micro
from erag.evaluate.statistics import Interval, bootstrap
from erag.evaluate.text import GENERIC, Golden, SemanticSimilarity
from erag.lm.roles import Caption, Embedder, LMBackend

_RESAMPLES = 1000
_COMMON = 5  # classes that a control says of every image


def captioned(backend: LMBackend, items: Sequence[Any]) -> list[Any]:
    """The captions of the items' images."""
    images = [Path(item["image"]) for item in items]
    found = each(backend.caption, images, backend.batch_size("caption"))
    return [None if c is None else {"text": c.text, "objects": list(c.objects)} for c in found]


def rendered(worlds: WorldsConfig) -> Path:
    """The folder of the worlds, with true captions and without nodes of objects; rendered where one is missing."""
    from erag.study.worlds import render

    render(worlds.folder, worlds.names, worlds.seed, objects=False, captions="truth")
    return worlds.folder


class Objects(RoleTrial):
    """Objects said against objects in view, micro-averaged F1 over the classes of the simulator."""

    role, measure = "caption", "object F1"

    def __init__(self, config: ObjectsTrial, worlds: WorldsConfig) -> None:
        self._config, self._worlds = config, worlds

    @cached_property
    def items(self) -> Sequence[Any]:
        from erag.study.worlds import read_worlds

        folder = rendered(self._worlds)
        worlds = read_worlds(folder)
        examples = [example for name in self._worlds.names for example in worlds[name]]
        classes = sorted(set().union(*(e.seen(self._config.least_share) for e in examples)))
        kept = drawn(examples, self._config.count, self._config.seed, str(folder))
        return [
            {"image": str(e.image), "seen": sorted(e.seen(self._config.least_share)), "classes": classes} for e in kept
        ]

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        return captioned(asked.backend, items)

    def controls(self) -> Mapping[str, Outputs]:
        """The classes that are most often in view, said of every image."""
        counts = Counter(name for item in self.items for name in item["seen"])
        often = [name for name, _ in sorted(counts.items(), key=lambda known: (-known[1], known[0]))][:_COMMON]
        return {f"the {_COMMON} commonest classes": [{"text": "", "objects": often} for _ in self.items]}

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        del embedder
        classes = self.items[0]["classes"]
        said = [self._named(output, classes) for output in outputs]
        counts = counted(said, [frozenset(item["seen"]) for item in self.items], classes)
        precision, recall, f1 = micro(counts.sum(axis=1), _RESAMPLES)
        loss = Interval(1 - f1.mean, 1 - f1.high, 1 - f1.low)
        return Judgement(f1, loss, {"precision": precision, "recall": recall})

    def _named(self, output: Any, classes: Sequence[str]) -> frozenset[str]:
        """The classes an output names: its objects, or where it lists none, what its text mentions."""
        if output is None:
            return frozenset()
        if output["objects"]:
            listed = {" ".join(words(name)) for name in output["objects"]}
            return frozenset(c for c in classes if not listed.isdisjoint(self._spellings(c)))
        text = f" {' '.join(words(output['text']))} "
        return frozenset(c for c in classes if any(f" {s} " in text or f" {s}s " in text for s in self._spellings(c)))

    def _spellings(self, name: str) -> set[str]:
        return {" ".join(words(spelling)) for spelling in (name, *self._config.synonyms.get(name, ()))}


class Captions(RoleTrial):
    """SS of captions to those of a cloud model, and how many of the things it mentions they mention."""

    role, measure = "caption", "SS to the cloud's caption"

    def __init__(self, config: CaptionsTrial) -> None:
        self._config, self.against = config, config.cloud

    @cached_property
    def items(self) -> Sequence[Any]:
        reading = read(self._config.source)
        known = [
            {"image": str(reading.root / seen.image), **_plain(cloud_caption(seen))}
            for seen in reading.observations
            if seen.caption and seen.image and (reading.root / seen.image).is_file()
        ]
        return drawn(known, self._config.count, self._config.seed, str(self._config.source))

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        return captioned(asked.backend, items)

    def cloud(self) -> Outputs:
        return [{"text": item["text"], "objects": item["objects"]} for item in self.items]

    def controls(self) -> Mapping[str, Outputs]:
        generic = {"text": GENERIC, "objects": []}
        return {
            "a caption of another frame": shifted(self.cloud()),
            "a generic sentence": [generic for _ in self.items],
        }

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        told = [_told(output) for output in outputs]
        golden = [Golden(_told(output)) for output in self.cloud()]
        scores = SemanticSimilarity("judge", embedder).scores([""] * len(told), told, golden)
        return Judgement.of([s.ss for s in scores], {"things mentioned": bootstrap([s.coverage for s in scores])})


def _plain(caption: Caption) -> dict[str, Any]:
    return {"text": caption.text, "objects": list(caption.objects)}


def _told(output: Any) -> str:
    """A caption as one text; objects it lists are told at the end, whoever it is by."""
    if output is None:
        return ""
    listed = f" Objects: {', '.join(output['objects'])}." if output["objects"] else ""
    return f"{output['text']}{listed}"
