"""Tokens a second of language model engines, against one plain llama.cpp stream in the same run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from erag.bench.config import ThroughputBench
from erag.core.progress import Progress, quiet
from erag.lm.config import LlamaCppRoles, TorchLMRoles, text_engine
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.roles import Prompt
from erag.lm.textmodel import TextModel
from erag.lm.weights import ModelStore

PLAIN = "plain stream"
Engine = LlamaCppRoles | TorchLMRoles


@dataclass(frozen=True, slots=True)
class Speed:
    """Tokens a second read and written with `prompts` prompts at once, medians over the repeats."""

    engine: str
    prompts: int
    prefill: float
    decode: float


def run(
    config: ThroughputBench,
    store: ModelStore,
    progress: Progress = quiet,
    engines: Mapping[str, TextModel] | None = None,
) -> Iterator[Speed]:
    """The plain stream first, then each engine at each size; all within one process. `engines` replaces them all."""
    models = dict(engines or _engines(config, store))
    jobs = [(name, size) for name in models for size in ((1,) if name == PLAIN else config.sizes)]
    for done, (name, size) in enumerate(jobs):
        progress("engines", done, len(jobs))
        yield _measured(name, models[name], size, config)
    progress("engines", len(jobs), len(jobs))


def _engines(config: ThroughputBench, store: ModelStore) -> dict[str, TextModel]:
    plain = LlamaCppConfig(model=config.model, sequences=1, weights="shipped")
    return {PLAIN: text_engine(plain, store), **{n: text_engine(e, store) for n, e in config.engines.items()}}


def _measured(name: str, model: TextModel, size: int, config: ThroughputBench) -> Speed:
    """Reading is the time until the first token; writing what comes after it. The first of the repeats is a warm-up."""
    reads, writes = [], []
    for repeat in range(config.repeats + 1):
        read, _, first = _timed(model, _prompts(config, size, repeat, most=1))
        _, wrote, whole = _timed(model, _prompts(config, size, repeat, most=config.answer))
        if repeat:
            reads.append(read / first)
            writes.append(max(wrote - size, 0) / max(whole - first, 1e-9))
    return Speed(name, size, median(reads), median(writes))


def _timed(model: TextModel, prompts: Sequence[Prompt]) -> tuple[int, int, float]:
    """Tokens read, tokens written, seconds."""
    start = time.perf_counter()
    done = model.generate(prompts)
    seconds = time.perf_counter() - start
    return sum(g.tokens_in for g in done), sum(g.tokens_out for g in done), seconds


def _prompts(config: ThroughputBench, size: int, repeat: int, most: int) -> list[Prompt]:
    """Prompts that differ from their first words on, so that nothing is shared, and ask for a long answer."""
    return [
        Prompt(
            (("user", f"{_counting((repeat * 1000 + size) * 100 + i, config.words)} Go on counting for a long time."),),
            max_tokens=most,
        )
        for i in range(size)
    ]


def _counting(start: int, words: int) -> str:
    return " ".join(str(1000 + start * 37 + i) for i in range(words // 2))
