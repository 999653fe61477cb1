"""Parts of the training of students: figures, thresholds, targets, variants, splits."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from erag.lm.tagger import labels
from erag.pipeline.config import configs_dir, read_yaml, validate
from erag.study.augment import look, seen_through, varied
from erag.study.config import DistilConfig
from erag.study.examples import Example, Instance, divided, words_of
from erag.study.judging import judge_words, searched
from erag.study.targets import targets
from erag.study.thresholds import best_thresholds
from erag.study.worlds import read_worlds


def _example(*instances: Instance, place: str = "park", variant: int = 0) -> Example:
    return Example(Path("w/0.jpg"), "w", place, "at night", "A park.", instances, variant)


BENCH = Instance("bench", 0.04, (0.25, 0.5, 0.5, 0.75), "red", "wooden", 4.0)
SMALL = Instance("bench", 0.007, (0.8, 0.5, 0.9, 0.6), "green", "metal", 30.0)
BIN = Instance("bin", 0.006, (0.9, 0.9, 1.0, 1.0), "green")


def test_a_class_of_the_truth_that_nobody_knows_counts_as_missed() -> None:
    judged = judge_words([frozenset({"bench"})], ["park"], [_example(BENCH, Instance("ufo", 0.5, (0, 0, 1, 1)))],
                         ["bench"], 0.01, 20)  # fmt: skip
    assert judged.quality.recall.mean == 0.5
    assert judged.quality.precision.mean == 1.0
    assert judged.worlds.keys() == {"w"}


def test_thresholds_are_where_f1_is_best_and_rare_classes_stay_near_the_common_one() -> None:
    truth = np.zeros((200, 2), np.int8)
    truth[:80, 0] = 1
    truth[0, 1] = 1
    chances = np.where(truth == 1, 0.45, 0.25).astype(np.float32)
    chances[0, 1] = 0.9
    frequent, rare = best_thresholds(chances, truth)
    assert 0.25 < frequent <= 0.45
    assert 0.25 < rare <= 0.45
    unknown = np.full_like(truth, -1)
    assert best_thresholds(chances, unknown).shape == (2,)


def test_targets_say_what_is_there_and_what_does_not_count() -> None:
    examples = [_example(BENCH, SMALL, BIN), _example(place="yard")]
    words = words_of(examples, 0.01, 1)
    assert (words.objects, words.colours, words.shapes) == (("bench",), ("red",), ("wooden",))
    assert words.places == ("park", "yard")
    known = words_of([*examples, _example(Instance("bin", 0.2, (0, 0, 1, 1), "green"))], 0.01, 1)
    truth = targets(examples, known, np.eye(2, 4, dtype=np.float32), 0.01)
    assert truth.presence.tolist() == [[1, -1], [0, 0]]
    assert truth.centre[0, 0].tolist() == [0.375, 0.625]
    assert truth.looks[0, 0].tolist() == [0, 1, 1]  # green, red, wooden
    assert truth.looks[0, 1].tolist() == [-1, -1, -1]
    assert (truth.many[0, 0], truth.far[0, 0]) == (0, 0)
    cells = truth.cells[0, 0].float() / 255
    assert float(cells.mean()) == pytest.approx(0.047, abs=0.005)  # both benches
    assert float(cells[9:13, 6:12].min()) > 0.5
    assert float(cells[:8].max()) == 0.0


def test_variants_are_the_same_every_time_and_carry_their_truth() -> None:
    assert look(_example(BENCH)) is None
    first, again, second = (look(_example(BENCH, variant=v)) for v in (1, 1, 2))
    assert first == again != second
    assert first is not None
    (moved,) = varied(_example(Instance("wall", 1.0, (0, 0, 1, 1), "red"), variant=1)).instances
    assert moved.box == (0, 0, 1, 1)
    assert (moved.share, moved.colour) == (1.0, "")
    pixels = np.zeros((60, 80, 3), np.uint8)
    pixels[30:45, 20:40] = 255  # where the bench is
    shown = seen_through(pixels, first)
    (bench,) = varied(_example(Instance("bench", 20 * 15 / 4800, (0.25, 0.5, 0.5, 0.75)), variant=1)).instances
    bright = shown.max(axis=2) > 128
    assert bright.mean() == pytest.approx(bench.share, abs=0.02)
    ys, xs = np.nonzero(bright)
    assert xs.mean() / 80 == pytest.approx((bench.box[0] + bench.box[2]) / 2, abs=0.03)
    assert ys.mean() / 60 == pytest.approx((bench.box[1] + bench.box[3]) / 2, abs=0.03)


def test_greys_keep_their_hue_and_the_image_as_it_is_stays() -> None:
    grey = np.repeat(np.random.default_rng(0).integers(0, 255, (20, 30, 1), np.uint8), 3, axis=2)
    assert seen_through(grey, None) is grey
    shown = seen_through(grey, look(_example(variant=3))).astype(int)
    assert np.ptp(shown, axis=2).max() <= 1


def test_whole_studios_or_runs_of_neighbours_set_the_thresholds() -> None:
    frames = [replace(_example(), image=Path(f"{i}.jpg")) for i in range(66)]
    learnt, apart = divided(frames, [], 4)
    assert [int(e.image.stem) for e in apart] == [*range(12, 16), *range(28, 32), *range(44, 48), *range(60, 64)]
    assert sorted(learnt + apart, key=lambda e: int(e.image.stem)) == frames
    learnt, apart = divided(frames[:2], [frames[i : i + 8] for i in range(2, 66, 8)], 4)
    assert apart == [*frames[26:34], *frames[58:66]]
    assert learnt == [*frames[:26], *frames[34:58]]


def test_text_search_counts_equal_captions_as_one() -> None:
    images = np.eye(3, dtype=np.float32)
    texts = np.array([[1, 0, 0], [0, 1, 0], [0, 1, 0]], np.float32)
    assert searched(images, texts) == (1.0, 1.0)
    assert searched(images[[1, 0, 2]], np.eye(3, dtype=np.float32))[0] == pytest.approx(1 / 3)


def test_the_simulators_truth_is_read(tmp_path: Path) -> None:
    (tmp_path / "truth").mkdir()
    row = {
        "node": "park-a-0001", "place": "lawn", "light": "morning", "weather": "misty", "caption": "A lawn.",
        "ndvi": 0.4,
        "objects": [
            {"instance": "x", "name": "bench", "share": 0.2, "box": [0, 0, 0.5, 1], "colour": "red", "metres": 3.0}
        ],
    }  # fmt: skip
    (tmp_path / "truth" / "park.jsonl").write_text(json.dumps(row) + "\n")
    (example,) = read_worlds(tmp_path)["park"]
    assert example.image == tmp_path / "worlds" / "park" / "images" / "park-a-0001.jpg"
    assert (example.place, example.light) == ("lawn", "in the morning in mist")
    assert example.things[0].centre == (0.25, 0.5)
    assert example.seen(0.01) == {"bench"}


def test_the_shipped_configuration_is_sound() -> None:
    raw = read_yaml(configs_dir() / "distil" / "captioner.yaml")
    config = validate(DistilConfig, raw, "captioner.yaml")
    assert not set(config.train) & set(config.held_out)
    assert len(config.train) == 10
    meant = [word for words in config.synonyms.values() for word in words]
    assert len(set(meant)) == len(meant)
    assert set(meant) <= {label.word for label in labels()}
