"""CLIP on a tiny open_clip model of random weights, saved as the real ones are (`make check-clip`)."""

import json
from pathlib import Path

import numpy as np
import pytest
from eyes_models import store_of
from PIL import Image

from erag.core.errors import ConfigError, ModelError
from erag.lm.clip import Clip, ClipConfig, read_words
from erag.lm.offline import go_offline
from erag.lm.weights import ModelStore

go_offline()

CONFIG = {
    "embed_dim": 16,
    "vision_cfg": {"image_size": 32, "layers": 2, "width": 32, "patch_size": 16, "head_width": 16},
    "text_cfg": {"context_length": 77, "vocab_size": 49408, "width": 32, "heads": 2, "layers": 2},
}
PREPARED = {
    "mean": [0.48, 0.45, 0.40],
    "std": [0.26, 0.26, 0.27],
    "interpolation": "bicubic",
    "resize_mode": "shortest",
}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    open_clip = pytest.importorskip("open_clip", reason="needs erag[clip], in an environment of its own")
    import torch
    from safetensors.torch import save_file

    root = tmp_path_factory.mktemp("clip")
    folder = root / "files" / "tiny-clip"
    folder.mkdir(parents=True)
    torch.manual_seed(0)
    model = open_clip.CLIP(**CONFIG)
    save_file(model.state_dict(), folder / "open_clip_model.safetensors")
    (folder / "open_clip_config.json").write_text(json.dumps({"model_cfg": CONFIG, "preprocess_cfg": PREPARED}))
    return store_of(root, "tiny-clip", "clip")


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("images")
    generator = np.random.default_rng(0)
    for i in range(4):
        Image.fromarray(generator.integers(0, 255, (40, 60, 3), np.uint8)).save(folder / f"{i}.png")
    return sorted(folder.iterdir())


def test_the_shipped_words_are_distinct() -> None:
    words = read_words(None)
    for part in ("places", "lights", "colours", "objects"):
        assert len(set(getattr(words, part))) == len(getattr(words, part))


def test_words_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / "words.yaml").write_text("places: []\n")
    with pytest.raises(ConfigError, match=r"words\.yaml"):
        read_words(tmp_path / "words.yaml")


@pytest.mark.parametrize("dtype", ["float32", "bfloat16"])
def test_captions_are_of_the_vocabulary_in_any_company(store: ModelStore, images: list[Path], dtype: str) -> None:
    config = ClipConfig.model_validate({"model": "tiny-clip", "dtype": dtype, "sure": 0.001, "most": 3})
    clip = Clip(config, store)
    captions = clip.caption(images)
    assert [clip.caption([path])[0] for path in images] == captions
    words = read_words(None)
    for caption in captions:
        assert len(caption.objects) == 3
        assert set(caption.objects) <= set(words.objects)
        assert any(place in caption.text.lower() for place in words.places)
        assert any(light in caption.text for light in words.lights)


def test_the_likeliest_words_are_those_of_open_clip(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    import open_clip
    import torch

    (tmp_path / "words.yaml").write_text(
        "places: [street, park]\nlights: [at night, in snow]\ncolours: [red, blue]\nobjects: [bench, tree]\n"
    )
    clip = Clip(ClipConfig(model="tiny-clip", words=tmp_path / "words.yaml", dtype="float32", sure=0.001), store)
    (caption,) = clip.caption(images[:1])
    folder = store.path("tiny-clip")
    model, _, prepare = open_clip.create_model_and_transforms(f"local-dir:{folder}")
    tokens = open_clip.get_tokenizer(f"local-dir:{folder}")(["a photo taken in a street.", "a photo taken in a park."])
    with torch.inference_mode():
        seen = model.encode_image(prepare(Image.open(images[0]))[None], normalize=True)
        best = (seen @ model.encode_text(tokens, normalize=True).T).argmax()
    assert caption.text.startswith(["A street", "A park"][int(best)])


def test_words_belong_to_the_identity(store: ModelStore, tmp_path: Path) -> None:
    (tmp_path / "words.yaml").write_text("places: [a]\nlights: [b]\ncolours: [c]\nobjects: [d]\n")
    one, two = (Clip(ClipConfig(model="tiny-clip", words=w), store) for w in (None, tmp_path / "words.yaml"))
    assert one.identity("caption") != two.identity("caption")


def test_a_folder_that_is_no_clip_is_refused(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "files" / "other"
    folder.mkdir(parents=True)
    (folder / "open_clip_config.json").write_text("{}")
    with pytest.raises(ModelError, match="is no open_clip model"):
        Clip(ClipConfig(model="other"), store_of(tmp_path, "other", "clip")).caption(images)
