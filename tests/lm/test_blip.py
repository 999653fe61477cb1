"""BLIP on a tiny model of random weights in the real format."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from eyes_models import store_of
from PIL import Image

from erag.core.errors import ModelError
from erag.lm.blip import Blip, BlipConfig, Preparation
from erag.lm.offline import go_offline
from erag.lm.weights import ModelStore

go_offline()
transformers = pytest.importorskip("transformers", reason="needs erag[blip]")

WORDS = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", "[DEC]", "[ENC]", "bench", "tree", "park", "street", "red"]
PREPARED = {"size": {"height": 32, "width": 48}, "image_mean": [0.4, 0.5, 0.6], "image_std": [0.2, 0.3, 0.4]}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    root = tmp_path_factory.mktemp("blip")
    folder = root / "files" / "tiny-blip"
    folder.mkdir(parents=True)
    (folder / "vocab.txt").write_text("\n".join(WORDS) + "\n")
    small = {"hidden_size": 32, "intermediate_size": 64, "num_hidden_layers": 2, "num_attention_heads": 2}
    config = transformers.BlipConfig(
        text_config={
            **small, "vocab_size": len(WORDS), "encoder_hidden_size": 32, "projection_dim": 16, "bos_token_id": 5,
            "max_position_embeddings": 64, "pad_token_id": 0, "eos_token_id": 3, "sep_token_id": 3,
            "initializer_range": 0.7,
        },
        vision_config={**small, "projection_dim": 16, "image_size": 32, "patch_size": 16, "initializer_range": 0.7},
        projection_dim=16, image_text_hidden_size=16,
    )  # fmt: skip
    torch.manual_seed(3)
    transformers.BlipForConditionalGeneration(config).save_pretrained(folder)
    transformers.BertTokenizer.from_pretrained(folder).save_pretrained(folder)
    prepared = {**PREPARED, "size": {"height": 32, "width": 32}}
    (folder / "preprocessor_config.json").write_text(json.dumps(prepared))
    return store_of(root, "tiny-blip", "blip")


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("images")
    generator = np.random.default_rng(0)
    for i in range(4):
        Image.fromarray(generator.integers(0, 255, (40, 60, 3), np.uint8)).save(folder / f"{i}.png")
    return sorted(folder.iterdir())


def test_images_are_prepared_as_the_librarys_own_processor_does() -> None:
    module = pytest.importorskip("transformers.models.blip.image_processing_pil_blip")
    pixels = np.random.default_rng(1).integers(0, 255, (50, 70, 3), np.uint8)
    theirs = module.BlipImageProcessorPil(**PREPARED)(Image.fromarray(pixels), return_tensors="np")["pixel_values"]
    ours = Preparation.model_validate(PREPARED)(pixels)
    assert np.abs(ours.numpy() - theirs).max() < 1e-5


@pytest.mark.parametrize("precision", ["float32", "bfloat16", "int8"])
def test_captions_are_those_of_the_library_in_any_company(
    store: ModelStore, images: list[Path], precision: str
) -> None:
    blip = Blip(BlipConfig.model_validate({"model": "tiny-blip", "precision": precision, "max_tokens": 6}), store)
    captions = blip.caption(images)
    assert [blip.caption([path])[0] for path in images] == captions
    assert all(
        word.lower() in [w.lower() for w in WORDS] for c in captions for word in c.text.removesuffix(".").split()
    )
    if precision == "float32":
        model = transformers.BlipForConditionalGeneration.from_pretrained(store.path("tiny-blip")).eval()
        tokenizer = transformers.AutoTokenizer.from_pretrained(store.path("tiny-blip"))
        prepare = Preparation.model_validate({**PREPARED, "size": {"height": 32, "width": 32}})
        pixels = prepare(np.asarray(Image.open(images[0])))
        tokens = model.generate(pixel_values=pixels, max_new_tokens=6, do_sample=False, num_beams=1)
        said = tokenizer.decode(tokens[0], skip_special_tokens=True)
        assert captions[0].text.lower() == f"{said}.".lower()


def test_precision_is_in_the_fingerprint_but_not_the_identity(store: ModelStore) -> None:
    one, two = (Blip(BlipConfig(model="tiny-blip", precision=p), store) for p in ("int8", "float32"))
    assert one.identity("caption") == two.identity("caption")
    assert one.fingerprint("caption") != two.fingerprint("caption")


def test_a_folder_that_is_no_blip_is_refused(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "files" / "other"
    folder.mkdir(parents=True)
    (folder / "config.json").write_text('{"model_type": "bert"}')
    with pytest.raises(ModelError, match="holds no safetensors"):
        Blip(BlipConfig(model="other"), store_of(tmp_path, "other", "blip")).caption(images)
    (folder / "model.safetensors").write_bytes(b"12345678{}")
    with pytest.raises(ModelError, match="is no BLIP captioner"):
        Blip(BlipConfig(model="other"), store_of(tmp_path, "other", "blip")).caption(images)
    (folder / "preprocessor_config.json").write_text('{"size": {"height": 1000000, "width": 3}}')
    with pytest.raises(ModelError, match="preprocessor_config"):
        Blip(BlipConfig(model="other"), store_of(tmp_path, "other", "blip")).caption(images)


def test_a_changed_file_is_refused_before_it_is_loaded(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    import shutil

    shutil.copytree(store.path("tiny-blip"), tmp_path / "files" / "tiny-blip")
    own = store_of(tmp_path, "tiny-blip", "blip")
    weights = tmp_path / "files" / "tiny-blip" / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"\x01")
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        Blip(BlipConfig(model="tiny-blip"), own).caption(images)
