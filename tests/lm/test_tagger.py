"""EfficientNet-Lite0 against plain torch, and the tagger on photographs whose subject is known."""

from pathlib import Path

import numpy as np
import pytest
import torch
import torch.nn.functional as nnf
from eyes_models import random_state

from erag.core.errors import ModelError
from erag.lm import efficientnet
from erag.lm.efficientnet import EfficientNetLite0, batch, load_network
from erag.lm.images import BadImages, load, resized
from erag.lm.tagger import Tagger, TaggerConfig, labels
from erag.lm.weights import ModelStore, default_store


def _plain(state: dict[str, torch.Tensor], x: torch.Tensor) -> torch.Tensor:
    """The network as it is written in the paper, normalisation apart, for inputs whose sides are multiples of 32."""

    def norm(x: torch.Tensor, name: str) -> torch.Tensor:
        w = [state[f"{name}.{part}"] for part in ("running_mean", "running_var", "weight", "bias")]
        return nnf.batch_norm(x, *w, eps=1e-3)

    def same(x: torch.Tensor, weight: torch.Tensor, stride: int, groups: int = 1) -> torch.Tensor:
        total = weight.shape[-1] - stride if stride > 1 else weight.shape[-1] - 1
        x = nnf.pad(x, (total // 2, total - total // 2) * 2)
        return nnf.conv2d(x, weight, None, stride, groups=groups)

    x = nnf.relu6(norm(same(x, state["_conv_stem.weight"], 2), "_bn0"))
    block = 0
    for count, _, first, expansion, channels in efficientnet._STAGES:
        for i in range(count):
            name, y = f"_blocks.{block}.", x
            if expansion > 1:
                y = nnf.relu6(norm(nnf.conv2d(y, state[f"{name}_expand_conv.weight"]), f"{name}_bn0"))
            deep = same(y, state[f"{name}_depthwise_conv.weight"], first if i == 0 else 1, y.shape[1])
            y = nnf.relu6(norm(deep, f"{name}_bn1"))
            y = norm(nnf.conv2d(y, state[f"{name}_project_conv.weight"]), f"{name}_bn2")
            x = x + y if y.shape == x.shape and (i > 0 or first == 1) and x.shape[1] == channels else y
            block += 1
    x = nnf.relu6(norm(nnf.conv2d(x, state["_conv_head.weight"]), "_bn1"))
    return nnf.linear(x.mean(dim=(2, 3)), state["_fc.weight"], state["_fc.bias"])


@pytest.fixture(scope="module")
def store() -> ModelStore:
    store = default_store()
    if store.state("efficientnet-lite0") == "missing":
        pytest.skip("no weights: erag models pull efficientnet-lite0")
    return store


def test_folding_the_normalisation_changes_nothing() -> None:
    state = random_state()
    images = torch.rand(2, 3, 64, 96) * 2 - 1
    with torch.inference_mode():
        ours, plain = EfficientNetLite0(state).logits(images), _plain(state, images)
    assert (ours - plain).abs().max() < 1e-4 * plain.abs().max()


def test_maps_have_the_strides_they_are_asked_for() -> None:
    with torch.inference_mode():
        maps = EfficientNetLite0(random_state()).maps(torch.zeros(1, 3, 96, 128), (8, 16, 32))
    assert [tuple(m.shape) for m in maps] == [(1, 40, 12, 16), (1, 112, 6, 8), (1, 320, 3, 4)]


def test_a_file_that_is_no_such_network_is_refused(tmp_path: Path) -> None:
    torch.save({"weight": torch.zeros(2)}, tmp_path / "other.pth")
    with pytest.raises(ModelError, match="is not EfficientNet-Lite0"):
        load_network(tmp_path / "other.pth")
    (tmp_path / "no.pth").write_bytes(b"not a state dict")
    with pytest.raises(ModelError, match="cannot be loaded"):
        load_network(tmp_path / "no.pth")
    wrong = {**random_state(), "_blocks.3._project_conv.weight": torch.zeros(48, 144, 1, 1)}
    torch.save(wrong, tmp_path / "wrong.pth")
    with pytest.raises(ModelError, match="is not EfficientNet-Lite0"):
        load_network(tmp_path / "wrong.pth")


def test_a_pickle_that_would_run_code_is_refused(tmp_path: Path) -> None:
    import pickle

    class Evil:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "ran",))

    (tmp_path / "evil.pth").write_bytes(pickle.dumps(Evil()))
    with pytest.raises(ModelError):
        load_network(tmp_path / "evil.pth")
    assert not (tmp_path / "ran").exists()


def test_there_are_a_thousand_labels() -> None:
    assert len(labels()) == 1000
    assert labels()[817].word == "car"
    assert (labels()[582].name, labels()[582].place) == ("grocery store", "a supermarket")


def photographs() -> dict[str, Path]:
    """Photographs that come with libraries the tests have: name -> file."""
    sklearn = pytest.importorskip("sklearn")
    matplotlib = pytest.importorskip("matplotlib")
    images = Path(sklearn.__file__).parent / "datasets" / "images"
    data = Path(matplotlib.__file__).parent / "mpl-data" / "sample_data"
    return {"temple": images / "china.jpg", "flower": images / "flower.jpg", "admiral": data / "grace_hopper.jpg"}


@pytest.mark.weights
@pytest.mark.parametrize(
    ("photo", "name"), [("temple", "palace"), ("flower", "daisy"), ("admiral", "military uniform")]
)
def test_the_real_weights_know_what_is_on_a_photograph(store: ModelStore, photo: str, name: str) -> None:
    pixels = load(photographs()[photo]).pixels
    height, width, _ = pixels.shape
    side = min(height, width)
    square = pixels[(height - side) // 2 :, (width - side) // 2 :][:side, :side]
    with torch.inference_mode():
        best = load_network(store.path("efficientnet-lite0")).logits(batch([resized(square, 224, 224)])).argmax()
    assert labels()[int(best)].name == name


@pytest.mark.weights
def test_captions_say_what_is_seen_and_do_not_depend_on_the_company(store: ModelStore) -> None:
    tagger, paths = Tagger(TaggerConfig(), store), list(photographs().values())
    together = tagger.caption(paths)
    assert [tagger.caption([path])[0] for path in paths] == together
    assert "palace" in together[0].objects
    assert "a palace" in together[0].text
    assert together[0].text.startswith("The view is ")


@pytest.mark.weights
def test_a_bad_image_is_named_and_nothing_is_captioned(store: ModelStore, tmp_path: Path) -> None:
    (tmp_path / "bad.jpg").write_text("no picture")
    with pytest.raises(BadImages, match=r"bad\.jpg"):
        Tagger(TaggerConfig(), store).caption([*photographs().values(), tmp_path / "bad.jpg"])


def test_thresholds_belong_to_the_identity(store: ModelStore) -> None:
    one, two = (Tagger(TaggerConfig(sure=s), store) for s in (0.25, 0.5))
    assert one.identity("caption") != two.identity("caption")
    assert one.identity("caption") in one.fingerprint("caption") or one.fingerprint("caption") != one.identity(
        "caption"
    )


def test_pixels_go_in_as_the_weights_were_trained() -> None:
    black, white = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 255, np.uint8)
    assert batch([black]).unique().tolist() == [-127 / 128]
    assert batch([white]).unique().tolist() == [1.0]
