"""Captioning a list in which some images, or some answers, are bad."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.core.errors import BadModelOutput, InputError
from erag.lm.captioning import caption_all, quarantine
from erag.lm.images import load, load_all
from erag.lm.roles import Caption, ImagePath, RoleName


class Painter:
    """Says the mean red of an image; is speechless when it is above 200."""

    def __init__(self) -> None:
        self.calls: list[int] = []

    def batch_size(self, role: RoleName) -> int:
        return 4

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        self.calls.append(len(images))
        reds = [int(p.pixels[:, :, 0].mean()) for p in load_all(images)]
        if max(reds) > 200:
            raise BadModelOutput("an empty caption")
        return [Caption(f"red {red}") for red in reds]


@pytest.fixture
def images(tmp_path: Path) -> list[Path]:
    paths = []
    for i in range(10):
        paths.append(tmp_path / "frames" / f"{i}.png")
        paths[-1].parent.mkdir(exist_ok=True)
        Image.fromarray(np.full((4, 4, 3), i * 10, np.uint8)).save(paths[-1])
    return paths


def test_broken_images_cost_the_others_nothing(images: list[Path]) -> None:
    images[2].write_bytes(images[2].read_bytes()[:30])
    images[7].write_text("no picture")
    done = caption_all(Painter(), images)
    assert [b.path for b in done.bad] == [images[2], images[7]]
    assert done.captions == {images[i]: Caption(f"red {i * 10}") for i in (0, 1, 3, 4, 5, 6, 8, 9)}


def test_an_image_without_an_answer_costs_its_batch_nothing(images: list[Path]) -> None:
    Image.fromarray(np.full((4, 4, 3), 250, np.uint8)).save(images[5])
    painter = Painter()
    done = caption_all(painter, images)
    assert [(b.path, b.reason) for b in done.bad] == [(images[5], "no caption: an empty caption")]
    assert len(done.captions) == 9
    assert painter.calls == [4, 4, 1, 1, 1, 1, 2]


def test_an_image_that_breaks_after_it_was_looked_at(images: list[Path]) -> None:
    class Late(Painter):
        def caption(self, paths: Sequence[ImagePath]) -> list[Caption]:
            images[1].unlink(missing_ok=True)
            return super().caption(paths)

    done = caption_all(Late(), images)
    assert [b.path for b in done.bad] == [images[1]]
    assert len(done.captions) == 9


def test_no_images_are_no_call() -> None:
    painter = Painter()
    assert caption_all(painter, []).captions == {}
    assert painter.calls == []


def test_quarantine_moves_files_and_links_but_nothing_outside(images: list[Path], tmp_path: Path) -> None:
    root, away = images[0].parent, tmp_path / "away"
    images[3].write_text("no picture")
    images[4].unlink()
    images[4].symlink_to(images[5])
    images[6].unlink()
    done = caption_all(Painter(), images)
    moved = quarantine(done.bad, root, away)
    assert moved == [away / "3.png", away / "4.png"]
    assert not images[3].exists()
    assert moved[1].is_symlink()
    assert load(images[5]).pixels.shape == (4, 4, 3)
    with pytest.raises(InputError, match="outside"):
        quarantine(caption_all(Painter(), [moved[0]]).bad, root, tmp_path / "b")


def test_quarantine_overwrites_nothing(images: list[Path], tmp_path: Path) -> None:
    (tmp_path / "away").mkdir()
    (tmp_path / "away" / "0.png").write_text("older")
    images[0].write_text("no picture")
    with pytest.raises(InputError, match="already holds"):
        quarantine(caption_all(Painter(), images).bad, images[0].parent, tmp_path / "away")
    assert images[0].exists()
