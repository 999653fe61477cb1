"""Reading image files that nobody has reason to trust: sniffed, bounded, decoded whole, made plain RGB."""

from __future__ import annotations

import io
import os
import stat
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError, ModelError, printable

if TYPE_CHECKING:
    from PIL import Image

Pixels = npt.NDArray[np.uint8]  # (h, w, 3) RGB, sRGB values
MAX_BYTES = 64 * 1024 * 1024  # of a file
MAX_PIXELS = 64_000_000  # of a decoded image, 192 MB as RGB
MAX_SIDE = 16_384
FORMATS = ("JPEG", "PNG", "WEBP", "TIFF", "BMP", "PPM")
_SUFFIXES = {
    "JPEG": (".jpg", ".jpeg", ".jpe", ".jfif"), "PNG": (".png", ".apng"), "WEBP": (".webp",), "TIFF": (".tif", ".tiff"),
    "BMP": (".bmp", ".dib"), "PPM": (".ppm", ".pgm", ".pbm", ".pnm", ".pfm"),
}  # fmt: skip
_MULTI = {"MPO": "JPEG"}  # a JPEG with further pictures behind the first
_ORIENTATION = 0x0112
_PNG_DEPTH = 24  # byte of the file that holds the bits a sample
_DEEP = ("I", "I;16", "I;16B", "I;16L", "I;16N")
_BROKEN = (
    OSError, SyntaxError, ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, ZeroDivisionError,
    struct.error, zlib.error, MemoryError,
)  # fmt: skip  # what Pillow's decoders raise for damaged files


@dataclass(frozen=True, slots=True)
class BadImage:
    """An image file that cannot be used, and why."""

    path: Path
    reason: str

    def line(self) -> str:
        """File and reason on one line."""
        return printable(f"{self.path}: {self.reason}")


class BadImages(InputError):
    """Images of a call that cannot be used, all of them named in `bad`; nothing of that call was captioned."""

    def __init__(self, bad: Sequence[BadImage]) -> None:
        self.bad = tuple(bad)
        more = f" (and {len(bad) - 1} more images)" if len(bad) > 1 else ""
        super().__init__(
            f"{bad[0].reason}{more}",
            where=str(bad[0].path),
            allowed=f"{', '.join(FORMATS)} of at most {MAX_PIXELS // 1_000_000} million pixels",
        )


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A decoded image: `pixels` (h, w, 3) uint8 RGB, upright, and what had to be converted (`notes`)."""

    pixels: Pixels
    notes: tuple[str, ...] = ()


def load(path: Path) -> Picture:
    """The image in a file as upright RGB.

    The type is taken from the content, never from the name. CMYK, palette, grey and 16-bit images are converted, alpha
    is laid on white, the EXIF rotation is applied, and of several frames the first is taken; `notes` say so. Raises
    BadImages for anything else: no regular file, a symbolic link, more than `MAX_BYTES`, no image of `FORMATS`, more
    than `MAX_PIXELS` or `MAX_SIDE` according to its header (nothing is decoded then), cut short or damaged.
    """
    data = read_file(path)
    with _refusing(path), _open(data) as image:
        found = _MULTI.get(str(image.format), str(image.format))
        _check_size(path, image.size)
        image.load()
        notes = [] if path.suffix.lower() in _SUFFIXES[found] else [f"named {path.name[-40:]!r}, is {found}"]
        if found == "PNG" and data[_PNG_DEPTH] == 16 and image.mode not in _DEEP:
            notes.append("16-bit made 8-bit")
        return _plain(image, notes)


def load_all(paths: Sequence[Path]) -> list[Picture]:
    """One picture a path, same order. Raises BadImages naming every path that cannot be used."""
    pictures: list[Picture] = []
    bad: list[BadImage] = []
    for path in paths:
        try:
            pictures.append(load(path))
        except BadImages as error:
            bad += error.bad
    if bad:
        raise BadImages(bad)
    return pictures


def sift(paths: Sequence[Path]) -> tuple[list[Path], list[BadImage]]:
    """The paths whose images can be used, in order, and the others with their reasons. Each image is decoded whole."""
    good: list[Path] = []
    bad: list[BadImage] = []
    for path in paths:
        try:
            load(path)
            good.append(path)
        except BadImages as error:
            bad += error.bad
    return good, bad


def resized(pixels: Pixels, width: int, height: int) -> Pixels:
    """(height, width, 3) pixels by bilinear interpolation over the area each output pixel covers."""
    image = _pillow()
    small = image.fromarray(pixels).resize((width, height), image.Resampling.BILINEAR, reducing_gap=3.0)
    return np.asarray(small, np.uint8)


def read_file(path: Path) -> bytes:
    """The bytes of a regular file of at most `MAX_BYTES`; links are not followed and pipes not waited for.

    Raises BadImages.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        raise _bad(path, "there is no such file") from None
    except (OSError, ValueError) as error:
        reason = "is a symbolic link" if path.is_symlink() else f"cannot be opened: {error}"
        raise _bad(path, reason) from None
    try:
        state = os.fstat(handle)
        if not stat.S_ISREG(state.st_mode):
            raise _bad(path, "is no regular file")
        if state.st_size > MAX_BYTES:
            raise _bad(path, f"has {state.st_size:,} bytes, more than {MAX_BYTES:,}")
        with open(handle, "rb", closefd=False) as file:
            return file.read(state.st_size)
    except OSError as error:
        raise _bad(path, f"cannot be read: {error.strerror}") from None
    finally:
        os.close(handle)


def _open(data: bytes) -> Image.Image:
    if not data:
        raise ValueError("the file is empty")
    image: Image.Image = _pillow().open(io.BytesIO(data), formats=FORMATS)
    return image


def _check_size(path: Path, size: tuple[int, int]) -> None:
    width, height = size
    if width * height > MAX_PIXELS or max(size) > MAX_SIDE:
        limit = f"{MAX_PIXELS:,} pixels and {MAX_SIDE:,} a side"
        raise _bad(path, f"its header says {width:,} × {height:,} pixels, more than {limit}")
    if min(size) < 1:
        raise _bad(path, f"its header says {width} × {height} pixels")


def _plain(image: Image.Image, notes: list[str]) -> Picture:
    """A decoded image as upright RGB."""
    from PIL import ImageOps

    if getattr(image, "n_frames", 1) > 1:
        notes.append(f"first of {image.n_frames} frames")  # type: ignore[attr-defined]
    turn = _orientation(image)
    if turn is None:
        notes.append("its EXIF cannot be read")
    elif turn in range(2, 9):
        image = ImageOps.exif_transpose(image)
        notes.append("rotated as its EXIF says")
    if image.mode in _DEEP:
        return Picture(_eight_bits(np.asarray(image).astype(np.int64)), (*notes, "16-bit made 8-bit"))
    if image.mode == "F":
        raise ValueError("its pixels are floating-point numbers without a known range")
    if image.has_transparency_data:
        rgba = image.convert("RGBA")
        white = _pillow().new("RGBA", rgba.size, (255, 255, 255, 255))
        return Picture(_rgb(_pillow().alpha_composite(white, rgba)), (*notes, "alpha laid on white"))
    if image.mode not in ("RGB", "L"):
        notes.append(f"{image.mode} made RGB")
    return Picture(_rgb(image), tuple(notes))


def _orientation(image: Image.Image) -> int | None:
    """The EXIF orientation (1 to 8, 1 is upright), None where the metadata alone are damaged."""
    try:
        return int(image.getexif().get(_ORIENTATION, 1))
    except _BROKEN:
        return None


def _eight_bits(grey: npt.NDArray[np.int64]) -> Pixels:
    """(h, w) values of 16 bits as (h, w, 3) of 8."""
    if grey.min() < 0 or grey.max() > 0xFFFF:
        raise ValueError("its pixels have more than 16 bits")
    return np.repeat((grey >> 8).astype(np.uint8)[:, :, None], 3, axis=2)


def _rgb(image: Image.Image) -> Pixels:
    return np.array(image.convert("RGB"), np.uint8)


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Make BadImages of whatever a decoder says of damaged content."""
    import warnings

    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on sizes (checked here) and on odd metadata
            yield
    except BadImages:
        raise
    except UnidentifiedImageError:
        raise _bad(path, f"is no image of the formats {', '.join(FORMATS)}") from None
    except Image.DecompressionBombError:
        raise _bad(path, f"its header says more than {MAX_PIXELS:,} pixels") from None
    except _BROKEN as error:
        raise _bad(path, f"is damaged or cut short: {str(error) or type(error).__name__}") from None


def _bad(path: Path, reason: str) -> BadImages:
    return BadImages([BadImage(path, reason)])


def _pillow() -> Any:
    try:
        from PIL import Image
    except ImportError as error:
        raise ModelError("the package pillow is not installed", repair="pip install 'erag[eyes]'") from error
    return Image
