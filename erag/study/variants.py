"""A language model in several GGUF formats: likelihood, decisions, speed and size of each, and the knee."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
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
from erag.lm.llamacpp.quantise import quantise, source_of, variants_store
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
_CARDS = 5  # of a decision made of the sample's labels


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
        """Nats a token lost against the first, caption by caption."""
        return paired_bootstrap(one.nats, self.measured[0].nats)

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
    """Make the variants, measure each, and write table and plot beside them. What has been measured is kept.

    Raises InputError for a source without captions, ModelError for a model that cannot be quantised.
    """
    go_offline()
    source = source_of(store, config.model)
    captions, decisions = _captions(config), _decisions(config)
    made = variants_store(config.out)
    stages = [*config.variants, *config.engines, SHIPPED]
    one: TextEngine
    measured = []
    for done, name in enumerate(stages):
        progress("variants", done, len(stages))
        if name in config.engines:
            engine, size = config.engines[name], source.path.stat().st_size
            one, weights = text_engine(engine, store), f"{store.fingerprint(engine.model)} {engine.model_dump_json()}"
        elif name == SHIPPED:
            one, size = _engine(config, config.model, store), source.path.stat().st_size
            weights = source.manifest.fingerprint
        else:
            manifest = quantise(source, name, config.out, threads=_threads(config))  # type: ignore[arg-type]
            made = variants_store(config.out)  # its manifests are read once
            one, size, weights = _engine(config, manifest.id, made), manifest.bytes or 0, manifest.fingerprint
        measured.append(_kept(config, name, weights, one, size, captions, decisions))
    progress("variants", len(stages), len(stages))
    measured.sort(key=lambda m: (-m.bytes, m.name))
    files = {m.name: (float(m.bytes), m.loss) for m in measured if m.name not in config.engines}
    report = Report(config.model, tuple(measured), knee(files))
    (config.out / "report.md").write_text(variants_report(config, report, source.whole), encoding="utf-8")
    pareto(
        config.out / "pareto.png", config.model, [(m.name, m.bytes, m.loss, m.decode) for m in measured], report.knee
    )
    return report


def _threads(config: GgufStudy) -> int:
    return config.threads or cores()


def _engine(config: GgufStudy, model: str, store: ModelStore) -> TextEngine:
    return text_engine(LlamaCppRoles(model=model, threads=config.threads, weights="shipped"), store)


def _kept(
    config: GgufStudy, name: str, weights: str, model: TextEngine, size: int, captions: Sequence[str],
    decisions: Sequence[Decision],
) -> Measured:  # fmt: skip
    """The figures of a variant, measured unless they were for the same weights and the same texts."""
    said = config.model_dump_json(include={"words", "answer", "threads"})
    asked = [json.dumps(asdict(d), sort_keys=True) for d in decisions]
    key = content_hash(weights, said, *captions, *asked).hex()[:16]
    file = config.out / "figures" / f"{name}-{key}.json"
    if file.is_file():
        raw = json.loads(file.read_text(encoding="utf-8"))
        return Measured(**{**raw, "nats": tuple(raw["nats"]), "right": tuple(raw["right"])})
    prefill, decode = _speed(config, model)
    found = Measured(name, size, _nats(model, captions), _right(model, decisions), prefill, decode)
    write_durably(file, json.dumps(asdict(found), indent=1))
    return found


def _nats(model: TextModel, captions: Sequence[str]) -> tuple[float, ...]:
    asked = [Continuation((("user", ASKED),), caption) for caption in captions]
    return tuple(-found.mean for found in model.likelihoods(asked))


def _right(model: TextEngine, decisions: Sequence[Decision]) -> tuple[float, ...]:
    picks = TextRoles(model).select([SelectTask(d.query, d.cards) for d in decisions], 1)
    return tuple(float(d.agrees(pick[0])) for d, pick in zip(decisions, picks, strict=True))


def _speed(config: GgufStudy, model: TextModel) -> tuple[float, float]:
    """Tokens a second read and written by one prompt at a time, medians of three after a warm-up."""
    reads, writes = [], []
    for turn in range(4):
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
    found = read_decisions(config.decisions) if config.decisions else _labelled()
    return found[:: max(1, len(found) // config.choices)][: config.choices]


def _labelled() -> list[Decision]:
    """Decisions of the sample: a caption that answers a labelled query, among four that do not."""
    captions = {o.id: o.caption for o in read(sample_dir()).observations if o.caption}
    rng, made = np.random.default_rng(0), []
    for query in read_labelled(sample_queries(), {}):
        text = (query.line.raw or {}).get("query")
        good = sorted(node for node in query.relevant if node in captions)
        bad = sorted({captions[n] for n in captions if n not in query.relevant} - {captions[n] for n in good})
        if text and good and len(bad) >= _CARDS - 1:
            cards = [captions[good[int(rng.integers(len(good)))]], *rng.choice(bad, _CARDS - 1, replace=False).tolist()]
            order = rng.permutation(_CARDS)
            made.append(Decision(str(text), tuple(cards[i] for i in order), int(np.flatnonzero(order == 0)[0])))
    return made
