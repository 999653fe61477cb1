"""Signs read by OCR: with the models of the package, and without a network."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from erag.core.errors import ModelError
from erag.lm.config import BackendConfig
from erag.lm.images import load
from erag.lm.roles import Caption, ImagePath, RoleName
from erag.lm.signs import Reader, Signs, SignsConfig, _plain, told
from erag.lm.tagger import TaggerConfig


class Blank:
    """A captioner that says the same of everything."""

    roles: frozenset[RoleName] = frozenset({"caption"})

    def identity(self, role: RoleName) -> str:
        return "blank"

    def fingerprint(self, role: RoleName) -> str:
        return "blank 1"

    def batch_size(self, role: RoleName) -> int:
        return 4

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        return [Caption("A street.", ("street",)) for _ in images]


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("street") / "street.png"
    image = Image.new("RGB", (512, 384), (120, 160, 120))
    draw = ImageDraw.Draw(image)
    draw.rectangle((60, 60, 330, 150), (20, 60, 140))
    draw.text((80, 80), "BAKERY", font=ImageFont.load_default(48), fill=(255, 255, 255))
    draw.text((300, 250), "Exit 12", font=ImageFont.load_default(30), fill=(10, 10, 10))
    image.save(path)
    return path


def test_writing_is_quoted_in_the_caption(street: Path, tmp_path: Path) -> None:
    pytest.importorskip("rapidocr", reason="needs erag[ocr]")
    Image.fromarray(np.full((96, 128, 3), 130, np.uint8)).save(tmp_path / "wall.png")
    signs = Signs(SignsConfig(captioner=TaggerConfig()), Blank())
    captions = signs.caption([street, tmp_path / "wall.png"])
    assert captions[0] == Caption('A street. There is writing that reads "BAKERY" and "Exit 12".', ("street",))
    assert captions[1] == Caption("A street.", ("street",))
    assert json.loads(signs.fingerprint("caption"))["inner"] == "blank 1"


@pytest.mark.offline
def test_reading_needs_no_network(street: Path) -> None:
    pytest.importorskip("rapidocr", reason="needs erag[ocr]")
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rn", "true"], check=False).returncode:
        pytest.skip("no network namespaces here")
    code = (
        "import sys; from pathlib import Path; from erag.lm.images import load; from erag.lm.signs import Reader;"
        "print(Reader(0.8, 2, 4).read(load(Path(sys.argv[1])).pixels))"
    )
    run = ["unshare", "-rn", sys.executable, "-c", code, str(street)]
    done = subprocess.run(run, capture_output=True, text=True, check=True, env={**os.environ})
    assert "('BAKERY', 'Exit 12')" in done.stdout


def test_models_that_are_missing_are_not_fetched(street: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("rapidocr", reason="needs erag[ocr]")
    from importlib.machinery import ModuleSpec

    from erag.lm import signs

    spec = ModuleSpec("rapidocr", None, is_package=True)
    spec.submodule_search_locations = [str(tmp_path)]
    monkeypatch.setattr(signs, "find_spec", lambda name: spec)
    signs._engine.cache_clear()
    with pytest.raises(ModelError, match="comes without its models"):
        Reader(0.8, 2, 4).read(load(street).pixels)
    signs._engine.cache_clear()


def test_a_text_of_the_world_stays_a_text() -> None:
    assert _plain('EXIT"\n\x1b[31m ignore “all”') == "EXIT [31m ignore all"
    assert len(_plain("x" * 500)) == 60
    assert told(Caption("A wall."), ()) == Caption("A wall.")


def test_a_configuration_names_the_captioner_inside() -> None:
    raw = {
        "models": {"eyes": {"kind": "signs", "captioner": {"kind": "tagger", "sure": 0.4}}},
        "roles": {"caption": "eyes"},
    }
    config = BackendConfig.model_validate(raw).models["eyes"]
    assert isinstance(config, SignsConfig)
    assert config.captioner == TaggerConfig(sure=0.4)
