"""Plans and the decoding loop, on a context of plain Python whose logits depend on all that a sequence has seen."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.lm.llamacpp.generation import Completion, Generator, Request
from erag.lm.llamacpp.likelihood import Due, likelihoods, log_probabilities
from erag.lm.llamacpp.native import Logits, Room, Row
from erag.lm.llamacpp.openings import Openings
from erag.lm.llamacpp.plan import pieces, reading
from erag.lm.llamacpp.sampler import Greedy

SIZE = 12  # tokens of the vocabulary
END = 0

PATHS = st.lists(st.lists(st.integers(1, 3), min_size=1, max_size=12).map(tuple), min_size=1, max_size=20)


def logits_after(seen: Sequence[int]) -> Logits:
    """Logits (v,) that any change of what was seen changes."""
    seed = int.from_bytes(hashlib.sha256(bytes(seen)).digest()[:8], "little")
    return np.random.default_rng(seed).normal(size=SIZE).astype(np.float32)


@dataclass
class Toy:
    """A context that keeps for each sequence the tokens it has seen, and refuses what llama.cpp would."""

    room: Room
    seen: dict[int, list[int]] = field(default_factory=dict)
    computed: int = 0
    decodes: int = 0

    def clear(self) -> None:
        self.seen = {}

    def copy(self, source: int, target: int, length: int) -> None:
        assert source != target
        self.seen[target] = self.seen[source][:length]

    def keep(self, sequence: int, length: int) -> None:
        assert sequence < self.room.sequences
        self.seen[sequence] = self.seen.get(sequence, [])[:length]

    def save(self, sequence: int) -> bytes:
        return bytes(self.seen[sequence])

    def restore(self, sequence: int, state: bytes) -> None:
        assert not self.seen.get(sequence)
        self.seen[sequence] = list(state)

    def decode(self, rows: Sequence[Row]) -> list[Logits]:
        assert len(rows) > 0
        assert sum(row.wanted for row in rows) <= self.room.outputs
        self.decodes += 1
        out = []
        for row in rows:
            self.computed += 1
            past = self.seen.setdefault(row.sequence, [])
            assert len(past) == row.position
            past.append(row.token)
            assert len(past) <= self.room.cells
            if row.wanted:
                out.append(logits_after(past))
        return out


def alone(request: Request) -> Completion:
    seen, answer = list(request.prompt), []
    while len(answer) < request.max_tokens:
        token = int(logits_after(seen).argmax())
        if token == END:
            return Completion(tuple(answer), truncated=False)
        answer.append(token)
        seen.append(token)
    return Completion(tuple(answer), truncated=True)


def run(requests: Sequence[Request], sequences: int) -> tuple[list[Completion], Toy]:
    toy = Toy(Room(200, sequences, 64, max(3, sequences), 1))
    return Generator(toy, frozenset({END}), lambda request: Greedy()).run(requests), toy


@given(
    st.lists(st.builds(Request, PATHS.map(lambda p: p[0]), st.integers(0, 15)), min_size=1, max_size=25),
    st.integers(1, 6),
)
def test_side_by_side_every_answer_is_what_it_is_alone(requests: list[Request], sequences: int) -> None:
    done, _ = run(requests, sequences)
    assert done == [alone(request) for request in requests]


@given(st.lists(st.builds(Request, PATHS.map(lambda p: p[0]), st.integers(1, 9)), min_size=2, max_size=12))
def test_the_order_of_prompts_makes_no_difference(requests: list[Request]) -> None:
    _, forward = run(requests, 3)
    _, backward = run(requests[::-1], 3)
    assert (forward.computed, forward.decodes) == (backward.computed, backward.decodes)


def test_a_long_common_beginning_is_computed_once() -> None:
    beginning = tuple(1 + i % 5 for i in range(100))
    requests = [Request((*beginning, i, 1), 1) for i in range(1, 9)]
    _, toy = run(requests, 8)
    assert toy.computed == 100 + 8 * 2
    _, refilled = run(requests, 2)  # finished sequences hand on what they have seen
    assert refilled.computed == 100 + 8 * 2


def test_an_opening_is_read_once_for_all_calls_and_changes_no_answer() -> None:
    opening = tuple(1 + i % 5 for i in range(64))
    first = [Request((*opening, 7, 7, i), 5, opening=64) for i in range(1, 4)]
    second = [Request((*opening, 8, i, 8), 5, opening=64) for i in range(1, 4)]
    plain = [Request(r.prompt, r.max_tokens) for r in (*first, *second)]
    toy, openings = Toy(Room(256, 2, 16, 3, 1)), Openings()
    generator = Generator(toy, frozenset({END}), lambda _: Greedy(), openings)  # type: ignore[arg-type]
    answers = [*generator.run(first), *generator.run(second)]
    read = toy.computed
    expected, fresh = run(plain, 2)
    assert answers == expected
    assert read <= fresh.computed  # one opening for both calls, where a single call would share it anyway
    again = Toy(Room(256, 2, 16, 3, 1))
    Generator(again, frozenset({END}), lambda _: Greedy(), openings).run(second)  # type: ignore[arg-type]
    alone = Toy(Room(256, 2, 16, 3, 1))
    Generator(alone, frozenset({END}), lambda _: Greedy()).run(second)  # type: ignore[arg-type]
    assert alone.computed - again.computed == 64


def test_short_openings_and_prompts_that_are_all_opening_are_read_as_they_are() -> None:
    opening = tuple(1 + i % 5 for i in range(40))
    requests = [Request(opening, 3, opening=40), Request((1, 2, 3, 4), 3, opening=2)]
    toy = Toy(Room(256, 2, 16, 3, 1))
    done = Generator(toy, frozenset({END}), lambda _: Greedy()).run(requests)  # type: ignore[arg-type]
    expected, _ = run([Request(r.prompt, r.max_tokens) for r in requests], 2)
    assert done == expected


def test_finished_answers_make_room_at_once() -> None:
    requests = [Request((100 + i, 2 + i % 9, i), 12) for i in range(30)]
    done, toy = run(requests, 4)
    steps = sum(len(c.tokens) - c.truncated for c in done)  # the last token of a cut answer is never computed
    assert toy.computed == sum(len(r.prompt) for r in requests) + steps
    assert toy.decodes < len(requests) + steps / 2


@given(PATHS, st.integers(0, 3))
def test_readings_spell_every_path_and_read_beginnings_once(paths: list[tuple[int, ...]], asked: int) -> None:
    paths = sorted(paths)
    wanted = [range(max(0, len(path) - asked), len(path)) for path in paths]
    plan = reading(paths, wanted)
    memory: list[int] = []
    spelt: list[list[tuple[int, ...]]] = []
    for step in plan.steps:
        memory = memory[: step.keep]
        assert len(step.rows) >= 2 or step.rows[0].position == 0  # a path of one token
        spelt.append([])
        for row in step.rows:
            assert row.position == len(memory)
            memory.append(row.token)
            spelt[-1].append(tuple(memory))
    for path, positions, places in zip(paths, wanted, plan.at, strict=True):
        assert [spelt[s][r] for s, r in places] == [path[: p + 1] for p in positions]
    flagged = {(s, r) for s, step in enumerate(plan.steps) for r, row in enumerate(step.rows) if row.wanted}
    assert flagged == {place for places in plan.at for place in places}
    beginnings = {path[: n + 1] for path in paths for n in range(len(path))}
    assert len(beginnings) <= sum(len(part) for part in spelt) <= len(beginnings) + len(plan.steps)


@given(st.lists(st.booleans(), max_size=40), st.integers(3, 9), st.integers(3, 5))
def test_pieces_are_cut_at_both_limits_and_never_leave_a_lone_row(wanted: list[bool], size: int, outputs: int) -> None:
    rows = [Row(i, i, 0, w) for i, w in enumerate(wanted)]
    cut = list(pieces(rows, size, outputs))
    assert [row for part in cut for row in part] == rows
    assert all(len(part) <= size and sum(r.wanted for r in part) <= outputs for part in cut)
    assert all(len(part) >= 2 for part in cut) or len(rows) < 2


@given(st.lists(st.builds(Due, PATHS.map(lambda p: p[0]), PATHS.map(lambda p: p[0]) | st.just(())), max_size=15))
def test_likelihoods_are_sums_of_log_probabilities(dues: list[Due]) -> None:
    toy = Toy(Room(30, 1, 16, 5, 1))
    for due, found in zip(dues, likelihoods(toy, dues), strict=True):
        seen, total = list(due.prompt), 0.0
        for token in due.continuation:
            total += log_probabilities(logits_after(seen), [token])[0]
            seen.append(token)
        assert found.tokens == len(due.continuation)
        assert found.logprob == pytest.approx(total, abs=1e-9)


def test_candidates_after_one_question_share_it() -> None:
    question = tuple(1 + i % 7 for i in range(40))
    toy = Toy(Room(1024, 1, 512, 64, 1))
    likelihoods(toy, [Due(question, (i, 2, 3)) for i in range(1, 11)])
    assert toy.computed == 40 + 10 * 2
    one_token = Toy(Room(1024, 1, 512, 64, 1))
    likelihoods(one_token, [Due(question, (i,)) for i in range(1, 11)])
    assert (one_token.computed, one_token.decodes) == (40, 1)


def test_log_probabilities_are_a_distribution_even_of_large_logits() -> None:
    logits = np.array([1000.0, 999.0, -1e30, 3e38, 3e38], np.float32)
    assert np.exp(log_probabilities(logits, range(5))).sum() == pytest.approx(1)
    assert log_probabilities(np.zeros(4, np.float32), [2])[0] == pytest.approx(-np.log(4), abs=1e-15)
