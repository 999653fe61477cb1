"""A vision-language model in llama.cpp: tiny random weights in a real GGUF and a real mmproj."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError

from erag.core.errors import ModelError
from erag.lm.images import BadImages
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.errors import ContextError
from erag.lm.llamacpp.library import library_version
from erag.lm.vlm import Vlm, VlmConfig, _whole
from erag.lm.weights import ModelStore

gguf = pytest.importorskip("gguf", reason="needs erag[torchlm]")
needs_llama = pytest.mark.skipif(library_version() is None, reason="no llama.cpp: pip install 'erag[llamacpp]'")

SIDE, PATCH, WIDTH, LAYERS = 32, 8, 32, 2


def _write_projector(path: Path, out: int) -> None:
    """A LLaVA-like projector: a small CLIP vision transformer, and two linear layers to `out` channels."""
    rng = np.random.default_rng(4)
    writer = gguf.GGUFWriter(str(path), "clip")
    writer.add_bool("clip.has_vision_encoder", True)
    writer.add_string("clip.projector_type", "mlp")
    writer.add_bool("clip.use_gelu", False)
    for key, value in {
        "image_size": SIDE, "patch_size": PATCH, "embedding_length": WIDTH, "feed_forward_length": 64,
        "block_count": LAYERS, "projection_dim": WIDTH, "attention.head_count": 2,
    }.items():  # fmt: skip
        writer.add_uint32(f"clip.vision.{key}", value)
    writer.add_float32("clip.vision.attention.layer_norm_epsilon", 1e-5)
    writer.add_array("clip.vision.image_mean", [0.5, 0.5, 0.5])
    writer.add_array("clip.vision.image_std", [0.5, 0.5, 0.5])

    def add(name: str, *shape: int) -> None:
        scale = 1.0 if len(shape) == 1 else float(np.prod(shape[1:])) ** -0.5
        writer.add_tensor(name, rng.normal(0, scale, shape).astype(np.float32))

    add("v.patch_embd.weight", WIDTH, 3, PATCH, PATCH)
    add("v.class_embd", WIDTH)
    add("v.position_embd.weight", (SIDE // PATCH) ** 2 + 1, WIDTH)
    for norm in ("v.pre_ln", "v.post_ln", *(f"v.blk.{i}.ln{n}" for i in range(LAYERS) for n in (1, 2))):
        add(f"{norm}.weight", WIDTH)
        add(f"{norm}.bias", WIDTH)
    for i in range(LAYERS):
        for part in ("attn_q", "attn_k", "attn_v", "attn_out"):
            add(f"v.blk.{i}.{part}.weight", WIDTH, WIDTH)
            add(f"v.blk.{i}.{part}.bias", WIDTH)
        for part, rows, columns in (("ffn_up", 64, WIDTH), ("ffn_down", WIDTH, 64)):
            add(f"v.blk.{i}.{part}.weight", rows, columns)
            add(f"v.blk.{i}.{part}.bias", rows)
    for layer, columns in ((0, WIDTH), (2, out)):
        add(f"mm.{layer}.weight", out, columns)
        add(f"mm.{layer}.bias", out)
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    sys.path.insert(0, str(Path(__file__).parent / "torchlm"))
    from torchlm_worlds import LLAMA, weights, write_gguf

    root = tmp_path_factory.mktemp("vlm")
    folder = root / "files" / "tiny-vlm"
    folder.mkdir(parents=True)
    write_gguf(folder / "tiny.gguf", LLAMA, weights(LLAMA))
    _write_projector(folder / "mmproj-tiny.gguf", LLAMA.width)
    return root


@pytest.fixture(scope="module")
def store(root: Path) -> ModelStore:
    from eyes_models import store_of

    return store_of(root, "tiny-vlm", "vlm", "gguf")


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("images")
    generator = np.random.default_rng(0)
    for i in range(3):
        Image.fromarray(generator.integers(0, 255, (40 + 20 * i, 60, 3), np.uint8)).save(folder / f"{i}.png")
    return sorted(folder.iterdir())


def _vlm(store: ModelStore, cache: Path, ledger: Ledger | None = None, **settings: object) -> Vlm:
    config = {"model": "tiny-vlm", "threads": 1, "context": 1024, "max_tokens": 8, "prompt": "Describe."} | settings
    return Vlm(VlmConfig.model_validate(config), store, ledger, cache=cache)


@needs_llama
def test_captions_depend_on_the_image_and_not_on_the_company(
    store: ModelStore, images: list[Path], tmp_path: Path
) -> None:
    vlm = _vlm(store, tmp_path)
    captions = vlm.caption(images)
    assert all(c.text for c in captions)
    assert len({c.text for c in captions}) > 1
    assert [vlm.caption([path])[0] for path in reversed(images)] == captions[::-1]
    assert _vlm(store, tmp_path).caption(images) == captions


@needs_llama
def test_model_and_projector_are_tried_in_a_child_first(store: ModelStore, images: list[Path], root: Path,
                                                        tmp_path: Path) -> None:  # fmt: skip
    from eyes_models import store_of

    folder = tmp_path / "files" / "broken"
    folder.mkdir(parents=True)
    (folder / "tiny.gguf").write_bytes((root / "files" / "tiny-vlm" / "tiny.gguf").read_bytes())
    whole = (root / "files" / "tiny-vlm" / "mmproj-tiny.gguf").read_bytes()
    (folder / "mmproj.gguf").write_bytes(whole[: len(whole) // 2])
    broken = Vlm(VlmConfig(model="broken", threads=1), store_of(tmp_path, "broken", "vlm", "gguf"), cache=tmp_path)
    with pytest.raises(ModelError, match=r"child process|cannot be loaded"):
        broken.caption(images)


@needs_llama
def test_an_image_that_does_not_fit_is_refused(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ContextError):
        _vlm(store, tmp_path, context=512, prompt="word " * 600).caption(images[:1])


@needs_llama
def test_a_caption_that_is_cut_is_counted(store: ModelStore, images: list[Path], tmp_path: Path) -> None:
    ledger = Ledger()
    _vlm(store, tmp_path, ledger, max_tokens=4).caption(images)
    assert ledger.events["captions cut at their cap of tokens"] > 0


def test_a_bad_image_is_named_before_anything_is_loaded(store: ModelStore, tmp_path: Path) -> None:
    (tmp_path / "bad.jpg").write_text("no picture")
    with pytest.raises(BadImages, match=r"bad\.jpg"):
        _vlm(store, tmp_path).caption([tmp_path / "bad.jpg"])


def test_a_model_without_a_projector_is_refused(images: list[Path], tmp_path: Path) -> None:
    from eyes_models import store_of

    (tmp_path / "files" / "blind").mkdir(parents=True)
    for name in ("a.gguf", "b.gguf"):
        (tmp_path / "files" / "blind" / name).write_bytes(b"GGUF")
    with pytest.raises(ModelError, match="mmproj"):
        Vlm(VlmConfig(model="blind"), store_of(tmp_path, "blind", "vlm", "gguf")).caption(images)


def test_prompts_and_cut_captions() -> None:
    with pytest.raises(ValidationError, match="stands for the image"):
        VlmConfig(model="m", prompt="Look at <__media__>")
    assert _whole("A street. There is a bench. On the le") == "A street. There is a bench."
    assert _whole("no sentence") == "no sentence"


def test_what_changes_captions_is_in_the_identity(store: ModelStore, tmp_path: Path) -> None:
    one, two, three = (_vlm(store, tmp_path, **s) for s in ({}, {"prompt": "Look."}, {"batch_size": 512}))
    assert one.identity("caption") != two.identity("caption")
    assert one.identity("caption") == three.identity("caption")
    assert one.fingerprint("caption") != three.fingerprint("caption")
