"""The students that come with the project play their roles with the code that is here."""

import json

import pytest

from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.checkpoints import shipped
from erag.lm.roles import SelectTask
from erag.lm.understanding import Understanding, UnderstandingConfig
from erag.lm.weights import ModelStore
from erag.retrieve.expand import asking


@pytest.mark.parametrize("name", ["selector", "selector-without-0", "scorer"])
def test_an_adapter_chooses_what_was_asked_for(weights: ModelStore, name: str) -> None:
    cards = ("Sofa corner. Soft chairs to rest on.", "Copy room. A printer and paper.", "Kitchen. A sink and a fridge.")
    adapter = Adapter(AdapterConfig(checkpoint=shipped(f"{name}.safetensors")), weights)
    assert adapter.select([SelectTask("Where can I print my report on paper?", cards)], 1)[0] == [1]


def test_the_student_of_understanding_names_what_would_satisfy(weights: ModelStore) -> None:
    (told,) = Understanding(UnderstandingConfig(), weights).generate([asking("I need to post a letter", 5)])
    assert {"post office", "mailbox", "postbox", "letterbox"} & set(json.loads(told.text)["things"])
