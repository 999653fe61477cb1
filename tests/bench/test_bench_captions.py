"""Captioners compared: what SS, its controls, objects and places are taken over."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.bench.captions import run
from erag.bench.config import BenchConfig, CaptionsBench
from erag.cli.main import run as erag
from erag.core.errors import InputError
from erag.lm.compose import compose
from erag.lm.images import load_all
from erag.lm.roles import Caption, RoleName, Roles
from erag.lm.weights import default_store
from erag.pipeline.config import configs_dir, read_yaml

SCENES = (
    ("park", "A park with a red bench and a fountain.", ("bench", "fountain")),
    ("kitchen", "A kitchen with an oven and a white table.", ("oven", "table")),
    ("street", "A street with a lorry beside a tall tree.", ("lorry", "tree")),
    ("library", "A library with many bookcases.", ("bookcase",)),
)
SEEN = {
    "split": "test", "world": "w", "visit": 1, "place_name": "", "standing_in": "", "indoor": False, "season": "summer",
    "light": "midday", "weather": "clear", "sky": 0.0, "ndvi": 0.0, "surfaces": {},
}  # fmt: skip


class Eyes:
    """Says of image i (whose pixels are 10 i) what `told` says."""

    roles: frozenset[RoleName] = frozenset({"caption"})

    def __init__(self, told: Sequence[Caption]) -> None:
        self.told = told

    def identity(self, role: RoleName) -> str:
        return "eyes"

    fingerprint = identity

    def batch_size(self, role: RoleName) -> int:
        return 3

    def caption(self, images: Sequence[Path]) -> list[Caption]:
        return [self.told[round(p.pixels.mean() / 10)] for p in load_all(images)]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "drive"
    (folder / "images").mkdir(parents=True)
    (folder / "meta.json").write_text('{"format": "erag-observations", "version": 1, "frame": "metric"}')
    rows = []
    for i, (_, caption, _) in enumerate(SCENES):
        Image.fromarray(np.full((6, 8, 3), i * 10, np.uint8)).save(folder / "images" / f"{i}.png")
        rows.append({"id": f"n{i}", "pose": {"x": i, "y": 0}, "image": f"images/{i}.png", "caption": caption})
    (folder / "observations.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder


def _config(source: Path, **other: object) -> CaptionsBench:
    raw = {"kind": "captions", "source": source, "captioners": {}, "embedder": {"kind": "fake"}, "samples": 100}
    return CaptionsBench.model_validate({**raw, **other})


def _eyes(captions: Sequence[Caption]) -> dict[str, object]:
    return {"eyes": compose({"eyes": Eyes(captions)}, Roles({"caption": "eyes"}))}


def test_ss_stands_beside_a_generic_text_and_other_images(source: Path) -> None:
    right = [Caption(text) for _, text, _ in SCENES]
    (score,) = run(_config(source), default_store(), captioners=_eyes(right))
    assert score.ss.mean == pytest.approx(1.0)
    assert score.coverage.mean == 1.0
    assert score.generic.mean < score.ss.mean
    assert score.others.mean < score.ss.mean
    assert score.objects is None
    same = [Caption("A park with a red bench and a fountain.")] * 4
    (score,) = run(_config(source, worst=1), default_store(), captioners=_eyes(same))
    assert score.ss.mean == pytest.approx(score.others.mean)
    assert [case.ss for case in score.worst] == [pytest.approx(min(c.ss for c in score.worst))]


def test_an_image_without_a_caption_counts_as_nothing_said(source: Path) -> None:
    (source / "images" / "3.png").write_bytes(b"broken")
    right = [Caption(text) for _, text, _ in SCENES]
    (score,) = run(_config(source), default_store(), captioners=_eyes(right))
    assert [image.path.name for image in score.bad] == ["3.png"]
    assert score.ss.mean == pytest.approx(0.75)


def test_objects_and_places_against_the_truth_at_its_threshold(source: Path, tmp_path: Path) -> None:
    thing = {"shape": "", "colour": "", "box": [0, 0, 1, 1], "side": "left", "metres": 1.0, "text": "", "beside": []}
    lines = []
    for i, (place, caption, names) in enumerate(SCENES):
        objects = [{**thing, "instance": f"{n}-1", "name": n, "share": 0.2} for n in names]
        objects.append({**thing, "instance": "cup-1", "name": "cup", "share": 0.002})
        lines.append({**SEEN, "node": f"n{i}", "place": place, "objects": objects, "caption": caption})
    truth = tmp_path / "w.jsonl"
    truth.write_text("".join(json.dumps(line) + "\n" for line in lines))
    said = [
        Caption("A park.", ("bench", "fountain")),
        Caption("A room.", ("stove", "cup")),
        Caption("A street.", ("tree",)),
        Caption("A library.", ("bench",)),
    ]
    config = _config(source, truth=[truth], synonyms={"oven": ["stove"]})
    (score,) = run(config, default_store(), captioners=_eyes(said))
    assert score.objects is not None
    assert score.objects.precision.mean == pytest.approx(4 / 5)  # the cup is too small to count for or against
    assert score.objects.recall.mean == pytest.approx(4 / 7)
    assert score.objects.place.mean == 0.75


def test_a_source_without_references_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "meta.json").write_text('{"format": "erag-observations", "version": 1, "frame": "metric"}')
    (folder / "observations.jsonl").write_text('{"id": "a", "pose": {"x": 0, "y": 0}, "caption": "A wall."}\n')
    with pytest.raises(InputError, match="no image has a reference caption"):
        list(run(_config(folder), default_store(), captioners={}))


def test_the_command_prints_tables_and_the_worst(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["bench", "--config", str(configs_dir() / "bench" / "captions.yaml"), "--set", f"source={source}",
               "--set", "truth=[]", "--set", "embedder={kind: fake}", "--set", "captioners={fake: {kind: fake}}",
               "--set", "worst=1"]  # fmt: skip
    assert erag(command) == 0
    said = capsys.readouterr().out
    assert "other images" in said
    assert said.count("reference: ") == 1


def test_the_shipped_configuration_is_one() -> None:
    raw = read_yaml(configs_dir() / "bench" / "captions.yaml")
    assert isinstance(BenchConfig.model_validate(raw).root, CaptionsBench)
