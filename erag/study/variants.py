"""A language model in several GGUF formats: likelihood, decisions, speed and size of each, and the knee."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from erag.core.cores import cores
from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.data.registry import read
from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.labelled import read_labelled
from erag.evaluate.statistics import Interval, bootstrap, paired_bootstrap
from erag.lm.config import LlamaCppRoles, text_engine
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.quantise import Source, discard, quantise, source_of, variants_store
from erag.lm.offline import go_offline
from erag.lm.roles import Prompt, SelectTask
from erag.lm.textmodel import Continuation, TextModel
from erag.lm.textroles import TextEngine, TextRoles
from erag.lm.weights import ModelStore
from erag.lm.weights.digest import write_durably
from erag.study.decisions import Decision, read_decisions
from erag.study.front import knee
from erag.study.plots import pareto
from erag.study.quantcard import variants_report
from erag.study.quantconfig import GgufStudy
from erag.study.shown import Shown

ASKED = "Describe what the robot sees."
SHIPPED = "shipped"


@dataclass(frozen=True)
class Measured:
    """A variant: its size, nats a token of each caption, which decisions it made right, tokens a second."""

    name: str
    bytes: int
    nats: tuple[float, ...]
    right: tuple[float, ...]
    prefill: float
    decode: float

    @property
    def loss(self) -> float:
        """Mean nats a token; e to this is the perplexity."""
        return float(np.mean(self.nats))


@dataclass(frozen=True)
class Report:
    """All variants, largest first, and which is the knee of size and loss."""

    model: str
    measured: tuple[Measured, ...]
    knee: str

    def difference(self, one: Measured) -> Interval:
        """Nats a token lost against the shipped file, which all are made of, caption by caption."""
        shipped = next(m for m in self.measured if m.name == SHIPPED)
        return paired_bootstrap(one.nats, shipped.nats)

    def table(self) -> Shown:
        """The figures for the terminal and the report."""
        header = ("variant", "MB", "nats a token", "lost", "decisions right", "read tok/s", "write tok/s")
        rows = [
            (f"{m.name} (knee)" if m.name == self.knee else m.name, f"{m.bytes / 1e6:.1f}", f"{m.loss:.4f}",
             f"{self.difference(m).mean:+.4f} [{self.difference(m).low:+.4f}, {self.difference(m).high:+.4f}]",
             str(bootstrap(m.right)), f"{m.prefill:.0f}", f"{m.decode:.0f}")
            for m in self.measured
        ]  # fmt: skip
        return Shown(header, rows, header[1:3])


def run(config: GgufStudy, store: ModelStore, progress: Progress = quiet) -> Report:
    """Make the variants one by one, measure each, and write table and plot. What has been measured is not made again.

    Raises InputError for a source without captions, ModelError for a model that cannot be quantised.
    """
    go_offline()
    source, study = source_of(store, config.model), _Study(config, store, _captions(config), _decisions(config))
    stages = [*config.variants, *config.engines, SHIPPED]
    measured = []
    for done, name in enumerate(stages):
        progress("variants", done, len(stages))
        measured.append(study.measured(name, source))
    progress("variants", len(stages), len(stages))
    measured.sort(key=lambda m: (-m.bytes, m.name))
    files = [m for m in measured if m.name not in config.engines]
    report = Report(config.model, tuple(measured), knee({m.name: (float(m.bytes), m.loss) for m in files}))
    (config.out / "report.md").write_text(variants_report(config, report, source.whole), encoding="utf-8")
    points = [(m.name, m.bytes, m.loss, m.decode) for m in files]
    pareto(config.out / "pareto.png", config.model, points, report.knee)
    return report


@dataclass(frozen=True)
class _Study:
    """What each variant is measured with; figures are kept in a file a variant."""

    config: GgufStudy
    store: ModelStore
    captions: Sequence[str]
    decisions: Sequence[Decision]

    def measured(self, name: str, source: Source) -> Measured:
        """The figures of a variant, of an engine, or of the shipped file."""
        size = source.path.stat().st_size
        if name in self.config.engines:
            engine = self.config.engines[name]
            said = f"{self.store.fingerprint(engine.model)} {engine.model_dump_json()}"
            return self._kept(name, said, lambda: self._figures(name, text_engine(engine, self.store), size))
        if name == SHIPPED:
            return self._kept(name, "", lambda: self._figures(name, self._engine(self.config.model, self.store), size))
        return self._kept(name, source.manifest.fingerprint, lambda: self._made(name, source))

    def _made(self, name: str, source: Source) -> Measured:
        """The figures of a variant that is quantised for it."""
        config = self.config
        manifest = quantise(source, name, config.out, threads=config.threads or cores())  # type: ignore[arg-type]
        made = variants_store(config.out)  # its manifests are read once
        found = self._figures(name, self._engine(manifest.id, made), manifest.bytes or 0)
        if not config.keep:
            discard(manifest.id, config.out)
        return found

    def _engine(self, model: str, store: ModelStore) -> TextEngine:
        return text_engine(LlamaCppRoles(model=model, threads=self.config.threads, weights="shipped"), store)

    def _figures(self, name: str, model: TextEngine, size: int) -> Measured:
        prefill, decode = _speed(self.config, model)
        return Measured(name, size, _nats(model, self.captions), _right(model, self.decisions), prefill, decode)

    def _kept(self, name: str, weights: str, measure: Callable[[], Measured]) -> Measured:
        """Measured, unless it was with the same weights, library and texts."""
        said = self.config.model_dump_json(include={"model", "words", "answer", "repeats", "threads"})
        asked = [json.dumps(asdict(d), sort_keys=True) for d in self.decisions]
        shipped, library = self.store.fingerprint(self.config.model), library_version() or ""
        key = content_hash(name, weights, shipped, library, said, *self.captions, *asked).hex()[:16]
        file = self.config.out / "figures" / f"{name}-{key}.json"
        if file.is_file():
            raw = json.loads(file.read_text(encoding="utf-8"))
            return Measured(**{**raw, "nats": tuple(raw["nats"]), "right": tuple(raw["right"])})
        found = measure()
        write_durably(file, json.dumps(asdict(found), indent=1))
        return found


def _nats(model: TextModel, captions: Sequence[str]) -> tuple[float, ...]:
    asked = [Continuation((("user", ASKED),), caption) for caption in captions]
    return tuple(-found.mean for found in model.likelihoods(asked))


def _right(model: TextEngine, decisions: Sequence[Decision]) -> tuple[float, ...]:
    picks = TextRoles(model).select([SelectTask(d.query, d.cards) for d in decisions], 1)
    return tuple(float(d.agrees(pick[0])) for d, pick in zip(decisions, picks, strict=True))


def _speed(config: GgufStudy, model: TextModel) -> tuple[float, float]:
    """Tokens a second read and written by one prompt at a time, medians after a warm-up."""
    reads, writes = [], []
    for turn in range(config.repeats + 1):
        read, _, first = _timed(model, _counting(config, 2 * turn, most=1))
        longer, wrote, whole = _timed(model, _counting(config, 2 * turn + 1, most=config.answer))
        if turn:
            reads.append(read / first)
            writes.append(wrote / max(whole - longer / reads[-1], whole / 20))  # a busy machine: no time below zero
    return float(np.median(reads)), float(np.median(writes))


def _counting(config: GgufStudy, turn: int, most: int) -> Prompt:
    """A prompt that differs from the others from its first words on, so that nothing is shared."""
    numbers = " ".join(str(1000 + turn * 7919 + i) for i in range(config.words // 2))
    return Prompt((("user", f"{numbers} Go on counting for a long time."),), max_tokens=most)


def _timed(model: TextModel, prompt: Prompt) -> tuple[int, int, float]:
    start = time.perf_counter()
    (done,) = model.generate([prompt])
    return done.tokens_in, done.tokens_out, time.perf_counter() - start


def _captions(config: GgufStudy) -> list[str]:
    path = sample_dir() if config.source == "sample" else Path(config.source)
    found = [o.caption for o in read(path).observations if o.caption]
    if not found:
        raise InputError("has no captions", where=str(path))
    return found[:: max(1, len(found) // config.texts)][: config.texts]


def _decisions(config: GgufStudy) -> list[Decision]:
    found = read_decisions(config.decisions) if config.decisions else _labelled(config.cards)
    return found[:: max(1, len(found) // config.choices)][: config.choices]


def _labelled(cards: int) -> list[Decision]:
    """Decisions of the sample: a caption that answers a labelled query, among others that do not."""
    captions = {o.id: o.caption for o in read(sample_dir()).observations if o.caption}
    rng, made = np.random.default_rng(0), []
    for query in read_labelled(sample_queries(), {}):
        text = (query.line.raw or {}).get("query")
        good = sorted(node for node in query.relevant if node in captions)
        bad = sorted({captions[n] for n in captions if n not in query.relevant} - {captions[n] for n in good})
        if text and good and len(bad) >= cards - 1:
            shown = [captions[good[int(rng.integers(len(good)))]], *rng.choice(bad, cards - 1, replace=False).tolist()]
            order = rng.permutation(cards)
            made.append(Decision(str(text), tuple(shown[i] for i in order), int(np.flatnonzero(order == 0)[0])))
    return made
