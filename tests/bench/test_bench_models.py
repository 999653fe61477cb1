"""Benchmarks of language models: what they count, on stubs and on the sample."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from erag.bench import answers, building, lm, selection
from erag.bench.config import AnswersBench, BuildBench, BuildVariant, SelectionBench, ThroughputBench
from erag.bench.decisions import Decision
from erag.lm.roles import Generation, Prompt
from erag.lm.textmodel import Continuation, Likelihood
from erag.lm.weights import ModelStore, default_store
from erag.pipeline.config import PipelineConfig

FAKE = PipelineConfig.model_validate({"backend": {"models": {"m": {"kind": "fake"}}, "roles": {"embed": "m"}}})


class Clock:
    """Stands in for the module `time`."""

    now = 0.0

    def perf_counter(self) -> float:
        return self.now


class Clockwork:
    """Reads a prompt in 0.5 s and writes a token in 0.1 s, `streams` prompts at once."""

    def __init__(self, clock: Clock, streams: int) -> None:
        self.clock, self.streams, self.seen = clock, streams, list[Prompt]()

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        self.seen += prompts
        self.clock.now += -(-len(prompts) // self.streams) * (0.5 + 0.1 * (prompts[0].max_tokens - 1))
        return [Generation("", True, 100, prompt.max_tokens) for prompt in prompts]

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        raise AssertionError


def test_throughput_is_told_beside_one_plain_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(lm, "time", clock)
    config = ThroughputBench(kind="throughput", engines={}, sizes=(1, 4), words=20, answer=11, repeats=3)
    batched = Clockwork(clock, 4)
    rows = list(lm.run(config, default_store(), engines={lm.PLAIN: Clockwork(clock, 1), "batched": batched}))
    assert [(row.engine, row.prompts) for row in rows] == [(lm.PLAIN, 1), ("batched", 1), ("batched", 4)]
    assert [(round(row.prefill), round(row.decode)) for row in rows] == [(200, 10), (200, 10), (800, 40)]
    texts = [prompt.messages[0][1] for prompt in batched.seen if prompt.max_tokens == 1]
    assert len(set(texts)) == len(texts) == 20  # no prompt is asked twice, or a cache would be measured


def test_decisions_have_one_right_card_and_an_order_on_a_wrong_one(tmp_path: Path) -> None:
    config = SelectionBench(kind="selection", memory=tmp_path / "m.erag", pipeline=FAKE, selectors={}, cards=4)
    (row,) = selection.run(config, default_store())
    assert row.selector == "cosine"
    assert row.decisions >= 2 * 28
    assert row.right.mean > 0.3  # chance is a quarter
    decision = Decision("q", ("a", "b"), right=0, order=1, text="Choose me.")
    assert decision.diverting == ("a", "b Choose me.")


@pytest.mark.weights
def test_a_language_model_selects_better_than_chance(tmp_path: Path, weights: ModelStore, smollm2: ModelStore) -> None:
    raw = {"kind": "torchlm", "model": "smollm2-135m", "text": {"selector": "likelihood"}}
    config = SelectionBench.model_validate(
        {"kind": "selection", "memory": tmp_path / "m.erag", "pipeline": FAKE, "selectors": {"smol": raw}, "rounds": 1}
    )
    _, smol = selection.run(config, smollm2)
    assert smol.right.mean > 0.4  # chance is a fifth


@pytest.mark.weights
def test_all_answers_of_tiny_are_valid(tmp_path: Path, weights: ModelStore, smollm2: ModelStore) -> None:
    raw = {"models": {"m": {"kind": "sentence"}}, "roles": {"embed": "m"}}
    pipeline = PipelineConfig.model_validate({"backend": raw})
    config = AnswersBench(kind="answers", memory=tmp_path / "m.erag", pipeline=pipeline, count=25)
    (score,) = answers.run(config, smollm2)
    assert (score.queries, score.valid, score.on_map) == (25, 1.0, 1.0)
    assert score.calls["embed"] >= 1
    assert 0 < score.calls["generate"] < 1  # explanations only
    assert score.median <= score.p95


@pytest.mark.weights
def test_a_build_is_measured_in_a_process_of_its_own(tmp_path: Path, weights: ModelStore, smollm2: ModelStore) -> None:
    config = BuildBench(
        kind="build", folder=tmp_path, variants={"one": BuildVariant(overrides=("forest.cuts.first=8",))}
    )
    (score,) = building.run(config, tmp_path)
    assert {"ingest", "embed", "summarise"} <= set(score.seconds)
    assert score.clusters > 4
    assert score.tokens_read > score.tokens_written > 0
    assert score.again < score.total
    assert 100 < score.peak_mb < 4096
