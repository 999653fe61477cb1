"""Captioning many images when some are broken: the broken ones are named, the rest is captioned."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from erag.core.errors import BadModelOutput, InputError
from erag.lm.images import BadImage, BadImages, sift
from erag.lm.roles import Caption, Captioner, ImagePath, RoleName


class BatchedCaptioner(Captioner, Protocol):
    """A captioner that says how many images a call takes."""

    def batch_size(self, role: RoleName) -> int: ...


@dataclass(frozen=True)
class Captioned:
    """`captions` by image path, and the images without one: no image has both, none has neither."""

    captions: dict[ImagePath, Caption]
    bad: tuple[BadImage, ...]


def caption_all(captioner: BatchedCaptioner, images: Sequence[ImagePath]) -> Captioned:
    """Caption every image that can be; the others are returned with the reason, never with a caption.

    All images are decoded once beforehand, so that the batches depend on the readable ones alone. A batch for which
    the model gives no caption is repeated image by image, so that one image costs no other its caption.
    """
    good, bad = sift(list(dict.fromkeys(images)))
    captions: dict[ImagePath, Caption] = {}
    size = captioner.batch_size("caption")
    for start in range(0, len(good), size):
        bad += _batch(captioner, good[start : start + size], captions)
    return Captioned(captions, tuple(bad))


def caption_batch(captioner: Captioner, images: Sequence[ImagePath]) -> Captioned:
    """As `caption_all` for one call of the captioner, whose images are not looked at beforehand."""
    captions: dict[ImagePath, Caption] = {}
    bad = _batch(captioner, list(dict.fromkeys(images)), captions)
    return Captioned(captions, tuple(bad))


def _batch(captioner: Captioner, images: Sequence[ImagePath], captions: dict[ImagePath, Caption]) -> list[BadImage]:
    """Add the captions of a batch; the images that got none. A file may have changed since it was looked at."""
    try:
        captions.update(zip(images, captioner.caption(images), strict=True))
        return []
    except BadImages as error:
        broken = {b.path for b in error.bad}
        left = [path for path in images if path not in broken]
        return [*error.bad, *(_batch(captioner, left, captions) if left else [])]
    except BadModelOutput as error:
        if len(images) == 1:
            return [BadImage(images[0], f"no caption: {error.what}")]
        return [b for image in images for b in _batch(captioner, [image], captions)]


def quarantine(bad: Sequence[BadImage], root: Path, folder: Path) -> list[Path]:
    """Move the bad images that lie in `root` to the same place under `folder`; where they are now.

    Only what is a file or a link is moved (a link as a link), what is gone is passed over. Raises InputError for an
    image outside `root`, and where another file is already in the place.
    """
    moved = []
    for image in bad:
        if not (image.path.is_symlink() or image.path.is_file()):
            continue
        place = folder / _relative(image.path, root)
        if place.exists() or place.is_symlink():
            raise InputError("already holds another file", where=str(place), repair="another folder for quarantine")
        place.parent.mkdir(parents=True, exist_ok=True)
        moved.append(Path(shutil.move(image.path, place)))
    return moved


def _relative(path: Path, root: Path) -> Path:
    try:
        return (path.parent.resolve() / path.name).relative_to(root.resolve())
    except ValueError:
        raise InputError("lies outside the folder of images", where=str(path), allowed=f"files in {root}") from None
