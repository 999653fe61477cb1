"""A student taught by drawn worlds, with a backbone of random weights: it learns, resumes, and its file is itself."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from drawings import draw_world
from eyes_models import random_state

pytest.importorskip("lightning", reason="needs erag[train]")

from safetensors.torch import load_file

from erag.core.errors import ConfigError, InputError, ModelError
from erag.lm.checkpoints import quantised, restored
from erag.lm.config import BackendConfig
from erag.lm.fake import FakeConfig
from erag.lm.student import Student, StudentConfig
from erag.lm.student_checkpoint import read_words
from erag.lm.weights import ModelStore
from erag.study.config import DistilConfig, TrainingConfig
from erag.study.distil import Report, distil
from erag.study.worlds import read_worlds


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    """A store whose backbone has random weights."""
    root = tmp_path_factory.mktemp("store")
    (root / "manifests").mkdir()
    (root / "files" / "backbone").mkdir(parents=True)
    torch.save(random_state(), root / "files" / "backbone" / "w.pth")
    digest = hashlib.sha256((root / "files" / "backbone" / "w.pth").read_bytes()).hexdigest()
    (root / "manifests" / "backbone.yaml").write_text(
        "id: backbone\ntitle: random\nkind: state_dict\nformat: pth\nroles: [features]\nlicence: none\n"
        f"files: [{{path: w.pth, sha256: {digest}}}]\n"
    )
    return ModelStore(root / "manifests", root / "files")


@pytest.fixture(scope="module")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("worlds")
    draw_world(root / "seed0", "one", 96, seed=1)
    draw_world(root / "held-out0", "two", 32, seed=2)
    return root


FAST = {"epochs": 25, "batch_size": 16, "rate": 1e-2, "average": 0.9, "channel_dropout": 0.0, "wandb": False}


def _config(worlds: Path, out: Path, **training: object) -> DistilConfig:
    return DistilConfig(
        kind="captioner", worlds=worlds, train=("one",), held_out=("two",), work=out / "work",
        out=out / "student.safetensors", backbone="backbone", width=32, depth=1, fewest=4, resamples=50, variants=0,
        backend=BackendConfig(models={"fake": FakeConfig()}, roles={"embed": "fake"}),
        training=TrainingConfig.model_validate(FAST | training),
    )  # fmt: skip


@pytest.fixture(scope="module")
def taught(worlds: Path, store: ModelStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[DistilConfig, Report]:
    config = _config(worlds, tmp_path_factory.mktemp("taught"))
    return config, distil(config, store)


def test_it_learns_what_is_drawn(taught: tuple[DistilConfig, Report]) -> None:
    _, report = taught
    held_out = report.figures["held-out worlds"]
    assert held_out.quality.f1.mean > 0.85
    assert held_out.quality.f1.low <= held_out.quality.f1.mean <= held_out.quality.f1.high
    assert held_out.quality.place.mean > 0.95
    assert held_out.offset is not None
    assert held_out.offset < 0.15
    assert held_out.colours is not None
    assert held_out.colours > 0.8
    assert held_out.search is not None
    assert held_out.search[1] > 5 / 32  # by chance
    assert report.bytes < 20_000_000


def test_the_card_and_the_figures_say_what_was_measured(taught: tuple[DistilConfig, Report]) -> None:
    config, report = taught
    card = config.out.with_suffix(".md").read_text()
    assert report.figures["held-out worlds"].quality.f1.shown(3) in card
    assert "| crate |" in card
    figures = json.loads((config.work / "figures.json").read_text())
    assert figures["held-out worlds"]["quality"]["f1"]["mean"] == report.figures["held-out worlds"].quality.f1.mean


def test_the_captioner_says_what_is_drawn(taught: tuple[DistilConfig, Report], worlds: Path, store: ModelStore) -> None:
    student = Student(StudentConfig(checkpoint=taught[0].out), store)
    examples = read_worlds(worlds / "held-out0")["two"]
    captions = student.caption([e.image for e in examples])
    right = [set(c.objects) == e.seen(0.01) for c, e in zip(captions, examples, strict=True)]
    assert np.mean(right) > 0.7
    i = next(i for i, (r, e) in enumerate(zip(right, examples, strict=True)) if r and len(e.things) == 2)
    left = min(examples[i].instances, key=lambda item: item.box[0])
    assert f"{left.colour} {left.name}" in captions[i].text
    assert captions[i].text.lower().startswith(f"a {examples[i].place}")
    assert student.caption([examples[i].image]) == [captions[i]]
    vectors = student.vectors([e.image for e in examples[:3]])
    assert vectors.shape == (3, 64)
    assert np.abs(np.linalg.norm(vectors, axis=1) - 1).max() < 1e-5


def test_a_killed_training_ends_with_the_same_student(
    taught: tuple[DistilConfig, Report], worlds: Path, store: ModelStore, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    from erag.study import loop

    class Killed(Exception):
        pass

    config, saved = _config(worlds, tmp_path), loop.Saving.on_train_epoch_end

    def kill(self: loop.Saving, trainer: object, pl_module: object) -> None:
        saved(self, trainer, pl_module)  # type: ignore[arg-type]
        if trainer.current_epoch == 5:  # type: ignore[attr-defined]
            raise Killed

    monkeypatch.setattr(loop.Saving, "on_train_epoch_end", kill)
    with pytest.raises(Killed):
        distil(config, store)
    monkeypatch.undo()
    assert not config.out.exists()
    distil(config, store)
    assert config.out.read_bytes() == taught[0].out.read_bytes()


def test_a_student_on_other_features_is_refused(taught: tuple[DistilConfig, Report], store: ModelStore) -> None:
    words = read_words(taught[0].out)
    assert words.weights == store.fingerprint("backbone")
    text = (store.manifests / "backbone.yaml").read_text()
    other = store.manifests.parent / "other"
    other.mkdir()
    (other / "backbone.yaml").write_text(text.replace(words.weights, "f" * 64))
    with pytest.raises(ModelError, match="was trained on features"):
        Student(StudentConfig(checkpoint=taught[0].out), ModelStore(other, store.files)).look(
            [read_worlds(taught[0].worlds / "seed0")["one"][0].image]
        )


def test_eight_bits_lose_little(taught: tuple[DistilConfig, Report]) -> None:
    small = load_file(taught[0].out)
    state = restored(small)
    assert quantised(state).keys() == small.keys()
    assert small["cells.weight.int8"].dtype == torch.int8
    torch.manual_seed(0)
    weight = torch.randn(16, 32, 3, 3)
    back = restored(quantised({"w": weight}))["w"]
    assert (back - weight).abs().max() <= weight.flatten(1).abs().amax(1).max() / 127 / 2 + 1e-6


def test_what_is_no_student_is_refused(tmp_path: Path, store: ModelStore) -> None:
    with pytest.raises(ModelError, match="no such checkpoint"):
        Student(StudentConfig(checkpoint=tmp_path / "none"), store).identity("caption")
    (tmp_path / "text").write_text("not a checkpoint")
    with pytest.raises(ModelError, match="no student's checkpoint"):
        Student(StudentConfig(checkpoint=tmp_path / "text"), store).identity("caption")


def test_worlds_that_cannot_be_used(worlds: Path, tmp_path: Path, store: ModelStore) -> None:
    with pytest.raises(ConfigError, match="held out"):
        distil(_config(worlds, tmp_path).model_copy(update={"train": ("two",)}), store)
    with pytest.raises(InputError, match="no data set of worlds"):
        read_worlds(tmp_path)
    (tmp_path / "truth").mkdir()
    row = {"node": "../../x", "place": "p", "caption": "c"}
    (tmp_path / "truth" / "w.jsonl").write_text(json.dumps(row) + "\n")
    with pytest.raises(InputError, match=r"w\.jsonl:1: node"):
        read_worlds(tmp_path)
    (tmp_path / "truth" / "w.jsonl").write_text('{"node": "x", "caption": "c"}\n')
    with pytest.raises(InputError, match=r"w\.jsonl:1: place"):
        read_worlds(tmp_path)
