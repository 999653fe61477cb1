"""Costs over the queries of a run."""

from __future__ import annotations

import pytest

from erag.data.contract import Result
from erag.evaluate.cost import Spread, Tokens, build_cost, cost
from erag.lm.ledger import Ledger
from erag.lm.roles import Generation


def test_costs_by_hand() -> None:
    results = [
        Result("a", seconds=1.0, visited=10, calls={"embed": 1}),
        Result("b", seconds=3.0, visited=30, calls={"embed": 1, "select": 4}),
        Result("c", seconds=99.0, error="line 3: not a JSON object"),
    ]
    found = cost(results, Tokens(5, 7))
    assert (found.queries, found.errors) == (2, 1)
    assert found.seconds == Spread(2.0, 2.0, pytest.approx(2.9), 3.0)
    assert found.visited.mean == 20
    assert found.calls == {"embed": 2, "select": 4}
    assert (found.per_query("select"), found.per_query("score")) == (2, 0)
    assert found.tokens == Tokens(5, 7)


def test_a_run_in_which_nothing_was_answered_has_no_cost() -> None:
    for results in ([], [Result("a", error="x")]):
        with pytest.raises(ValueError, match="finite and not negative"):
            cost(results)


def test_tokens_add_up() -> None:
    made = Tokens.of([Generation("a", False, 3, 1), Generation("b", True, 2, 4)])
    assert made == Tokens(5, 5, 1)
    assert made + Tokens(1, 1, 1) == Tokens(6, 6, 2)
    assert Tokens.of([]) == Tokens()


def test_a_build_is_told_by_stage_and_role() -> None:
    ledger = Ledger()
    ledger.calls["embed"], ledger.replayed["embed"], ledger.seconds["embed"] = 3, 2, 0.5
    ledger.events["truncated"] = 1
    assert build_cost(ledger, {"map": 1.0, "embed": 2.0}) == {
        "seconds.map": 1.0, "seconds.embed": 2.0, "seconds": 3.0,
        "computed.embed": 3.0, "replayed.embed": 2.0, "model_seconds.embed": 0.5, "event.truncated": 1.0,
    }  # fmt: skip
