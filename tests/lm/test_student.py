"""The student's words: from outputs to views to captions, and its checkpoint, without any training."""

from dataclasses import fields
from pathlib import Path

import pytest
import torch
from pydantic import ValidationError

from erag.core.errors import ModelError
from erag.lm.config import BackendConfig, build_backend
from erag.lm.features import COARSE, FINE
from erag.lm.student import Found, View, read_view, spoken
from erag.lm.student_checkpoint import load, read_words, save
from erag.lm.student_network import Seen, StudentNetwork
from erag.lm.student_words import StudentWords
from erag.lm.weights import ModelStore

WORDS = StudentWords(
    objects=("bench", "tree"), colours=("green", "red"), shapes=("wooden",), places=("office", "park"),
    lights=("", "at night"), thresholds=(0.5, 0.7), dim=8, width=16, depth=1, weights="0" * 64, embedder="e", rules=1,
)  # fmt: skip


def _seen(presence: list[float]) -> Seen:
    return Seen(
        presence=torch.tensor([presence]), centre=torch.tensor([[[0.1, 0.6], [0.5, 0.4]]]),
        looks=torch.tensor([[[-3.0, 2.0, 1.0], [1.0, -3.0, -2.0]]]), many=torch.tensor([[-1.0, 1.0]]),
        far=torch.tensor([[-1.0, 2.0]]), cells=torch.full((1, 2, 4, 4), -5.0), places=torch.tensor([[0.0, 3.0]]),
        lights=torch.tensor([[0.0, 1.0]]), vector=torch.zeros(1, 8),
    )  # fmt: skip


def test_outputs_become_a_view_and_a_view_a_caption() -> None:
    view = read_view(WORDS, _seen([2.0, 3.0]))
    assert (view.place, view.light) == ("park", "at night")
    assert [f.name for f in view.objects] == ["tree", "bench"]
    assert view.objects[1].colour == "red"
    assert spoken(view).text == (
        "A park at night. On the left is a red wooden bench. In the middle are several green trees in the distance."
    )


def test_a_class_is_said_from_its_own_threshold_on() -> None:
    assert [f.name for f in read_view(WORDS, _seen([0.5, 0.5])).objects] == ["bench"]  # 0.62 each
    assert read_view(WORDS, _seen([-1.0, -1.0])).objects == ()


def test_a_view_of_nothing_names_the_place() -> None:
    assert spoken(View("office", 0.9, "", ())).text == "An office."
    assert spoken(View("office", 0.9, "", (Found("desk", 0.9, 0.9, 0.5, 0.1),))).objects == ("desk",)


def test_an_image_and_its_mirror_image_are_seen_alike() -> None:
    torch.manual_seed(2)
    network = StudentNetwork(WORDS).eval()
    fine, coarse = torch.randn(2, FINE, 4, 6), torch.randn(2, COARSE, 2, 3)
    seen = network.both_ways(fine, coarse)
    again = network.both_ways(fine.flip(3), coarse.flip(3)).mirrored()
    for field in fields(Seen):
        torch.testing.assert_close(getattr(seen, field.name), getattr(again, field.name))
    assert not torch.allclose(seen.centre[..., 0], network(fine, coarse).centre[..., 0])


def test_a_checkpoint_is_read_as_it_was_written_and_is_the_same_bytes_again(tmp_path: Path) -> None:
    torch.manual_seed(1)
    network = StudentNetwork(WORDS)
    for name in ("a", "b"):
        save(tmp_path / name, WORDS, network.state_dict())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    words, again = load(tmp_path / "a")
    assert words == WORDS
    for (name, before), after in zip(network.state_dict().items(), again.state_dict().values(), strict=True):
        assert (before - after).abs().max() <= before.abs().max() / 127, name


def test_a_checkpoint_whose_weights_do_not_fit_is_refused(tmp_path: Path) -> None:
    save(tmp_path / "a", WORDS.model_copy(update={"objects": ("bench",), "thresholds": (0.5,)}),
         StudentNetwork(WORDS).state_dict())  # fmt: skip
    with pytest.raises(ModelError, match="do not fit"):
        load(tmp_path / "a")
    from safetensors.torch import save_file

    save_file({"x": torch.zeros(1)}, tmp_path / "other")
    with pytest.raises(ModelError, match="no student's checkpoint"):
        read_words(tmp_path / "other")


def test_words_that_contradict_themselves_are_refused() -> None:
    with pytest.raises(ValidationError, match="differ in number"):
        StudentWords.model_validate({**WORDS.model_dump(), "thresholds": (0.5,)})
    with pytest.raises(ValidationError, match="outside"):
        StudentWords.model_validate({**WORDS.model_dump(), "thresholds": (0.5, 1.5)})


@pytest.mark.parametrize(
    "model",
    [{"kind": "tagger"}, {"kind": "student"}, {"kind": "clip", "model": "m"}, {"kind": "blip", "model": "m"},
     {"kind": "vlm", "model": "m"}, {"kind": "signs", "captioner": {"kind": "tagger"}}],
)  # fmt: skip
def test_every_captioner_is_in_the_registry_and_loads_nothing_by_itself(model: dict[str, object]) -> None:
    config = BackendConfig.model_validate({"models": {"eyes": model}, "roles": {"caption": "eyes"}})
    backend = build_backend(config, ModelStore(Path("absent"), Path("absent")))
    assert backend.batch_size("caption") > 0
