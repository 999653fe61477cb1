"""The students that come with the project play their roles with the code that is here."""

import json
from pathlib import Path

import pytest

from erag.core.text import words
from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.checkpoints import shipped
from erag.lm.cross import CrossEncoder, CrossEncoderConfig
from erag.lm.merging import merge
from erag.lm.roles import Group, SelectTask
from erag.lm.textroles import TextRoles
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.understanding import Understanding, UnderstandingConfig
from erag.lm.weights import ModelStore
from erag.retrieve.expand import asking

CARDS = ("Sofa corner. Soft chairs to rest on.", "Copy room. A printer and paper.", "Kitchen. A sink and a fridge.")
TASK = SelectTask("Where can I print my report on paper?", CARDS)


@pytest.mark.parametrize("name", ["selector", "selector-without-0", "scorer"])
def test_an_adapter_chooses_what_was_asked_for(weights: ModelStore, name: str) -> None:
    assert Adapter(AdapterConfig(checkpoint=shipped(f"{name}.safetensors")), weights).select([TASK], 1)[0] == [1]


def test_the_cross_encoder_chooses_what_was_asked_for(weights: ModelStore) -> None:
    assert CrossEncoder(CrossEncoderConfig(), weights).select([TASK], 1)[0] == [1]


@pytest.mark.parametrize(
    ("name", "taught"), [("understanding", "understanding"), ("summaries", "summarise"), ("selector", "select")]
)
def test_an_adapter_of_a_language_model_fits_the_model_it_was_taught_on(
    smollm2: ModelStore, tmp_path: Path, name: str, taught: str
) -> None:
    """One taught on other weights would be refused."""
    made = merge(shipped(f"lora-{name}.safetensors"), smollm2, tmp_path)
    assert made.manifest.id == f"smollm2-135m-{taught}"


def test_summaries_come_from_the_adapter_as_it_is_loaded(smollm2: ModelStore, tmp_path: Path) -> None:
    group = Group((), ("often: bedroom, family house, carpet, red bed", "special: television, floor lamp"))
    plain, taught = (
        TextRoles(TorchLM(TorchLMConfig(lora=lora), smollm2, cache=tmp_path)).summarise([group])[0]
        for lora in (None, shipped("lora-summaries.safetensors"))
    )
    assert taught != plain
    assert {"bedroom", "carpet", "television"} <= set(words(taught.text))


def test_the_student_of_understanding_names_what_would_satisfy(weights: ModelStore) -> None:
    (told,) = Understanding(UnderstandingConfig(), weights).generate([asking("I need to post a letter", 5)])
    assert {"post office", "mailbox", "postbox", "letterbox"} & set(json.loads(told.text)["things"])
