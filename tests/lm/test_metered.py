"""Calls are counted where they are made."""

import pytest

from erag.core.errors import RoleMissing
from erag.lm.compose import compose
from erag.lm.fake import Fake
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
from erag.lm.roles import ROLES, Group, Prompt, Roles, SelectTask


def test_items_and_seconds_are_counted_by_role() -> None:
    ledger = Ledger()
    model = Metered(compose({"m": Fake()}, Roles(dict.fromkeys(ROLES, "m"))), ledger)
    model.embed(["a", "b"], "query")
    model.summarise([Group(("a",))])
    model.select([SelectTask("a", ("a", "b"))] * 3, 1)
    model.score([("a", "b")])
    model.generate([Prompt((("user", "a"),))])
    assert ledger.calls == {"embed": 2, "summarise": 1, "select": 3, "score": 1, "generate": 1}
    assert set(ledger.seconds) == set(ledger.calls)
    assert model.fingerprint("embed") == Fake().fingerprint("embed")


def test_what_raises_is_not_counted() -> None:
    ledger = Ledger()
    with pytest.raises(RoleMissing):
        Metered(compose({"m": Fake()}, Roles({"embed": "m"})), ledger).score([("a", "b")])
    assert not ledger.calls
