"""How many tokens a second a loaded model reads and writes; for `erag bench` and the documentation."""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

from erag.lm.torchlm.generating import Generator, Request
from erag.lm.torchlm.model import TorchLM
from erag.lm.torchlm.writer import FreeWriter


@dataclass(frozen=True, slots=True)
class Speed:
    """Tokens a second over all rows of a batch, medians over the repeats."""

    rows: int
    prefill: float
    decode: float


def measure(model: TorchLM, rows: int, prompt: int = 450, answer: int = 64, repeats: int = 3) -> Speed:
    """Read `rows` prompts of `prompt` tokens that share nothing, then write `answer` tokens each; once unmeasured.

    Decoding is the time of the whole answer less that of an answer of one token, which is reading.
    """
    generator, size = model.generator(), len(model.vocabulary().tokens) - 1000
    first, rest = [], []
    for repeat in range(repeats + 1):
        prompts = [tuple((row * 7919 + i * 104_729 + repeat) % size for i in range(prompt)) for row in range(rows)]
        reading = _seconds(generator, prompts, 1)
        writing = _seconds(generator, prompts, answer) - reading
        if repeat:
            first.append(rows * prompt / reading)
            rest.append(rows * (answer - 1) / writing)
    return Speed(rows, median(first), median(rest))


def _seconds(generator: Generator, prompts: list[tuple[int, ...]], answer: int) -> float:
    requests = [Request(prompt, answer, FreeWriter(frozenset(), answer)) for prompt in prompts]
    start = time.perf_counter()
    generator.run(requests)
    return time.perf_counter() - start
