"""Images of observations as small pictures inside the page; files are hostile until decoded."""

from __future__ import annotations

import base64
import math
import struct
import warnings
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from erag.core.errors import ConfigError, InputError, printable
from erag.data.files import inside, read_raw
from erag.data.reading import Issue
from erag.report.config import PictureConfig

if TYPE_CHECKING:
    from PIL.Image import Image

FORMATS = ("JPEG", "PNG", "WEBP", "BMP", "TIFF")
_LISTED = 20  # unreadable images named one by one
# What Pillow's decoders let through for files that are not what they say.
_BROKEN = (
    OSError,
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    SyntaxError,
    EOFError,
    struct.error,
    zlib.error,
)


@dataclass(frozen=True, slots=True)
class ImageFile:
    """The image of the node in a row: its folder and its path below that folder."""

    row: int
    root: Path
    path: str


@dataclass(frozen=True, slots=True)
class Pictures:
    """Thumbnails by row as `data:` addresses, and what is not shown and why."""

    by_row: dict[int, str]
    issues: tuple[Issue, ...] = ()


def thumbnails(files: Sequence[ImageFile], config: PictureConfig) -> Pictures:
    """A thumbnail of every image, the first ones first, up to `config.total_bytes`.

    An image that cannot be decoded within the limits becomes an issue. Raises ConfigError where Pillow is missing.
    """
    if not files:
        return Pictures({})
    _check_pillow()
    side = _side(len(files), config)
    made: dict[int, str] = {}
    issues, used, left_out = [], 0, 0
    for file in files:
        try:
            picture = "" if left_out else _thumbnail(file, side, config)
        except InputError as error:
            issues.append(Issue(printable(file.path, 200), error.what, "not shown"))
            continue
        used += len(picture)
        if left_out or used > config.total_bytes:
            left_out += 1
        else:
            made[file.row] = picture
    return Pictures(made, (*_shortened(issues), *_left_out(left_out, config)))


def _side(count: int, config: PictureConfig) -> int:
    """Pixels of the longer side: the area of all thumbnails stays what it is at `full_size` images."""
    shrunk = int(config.side * math.sqrt(config.full_size / max(count, config.full_size)))
    return min(config.side, max(config.least_side, shrunk))


def _thumbnail(file: ImageFile, side: int, config: PictureConfig) -> str:
    """One image file as a `data:` address. Raises InputError."""
    from PIL.Image import DecompressionBombError

    raw = _bytes(file, config)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the limit on pixels below is stricter than Pillow's warning
            return _encoded(_small(raw, side, config), config.quality)
    except InputError:
        raise
    except (*_BROKEN, DecompressionBombError) as error:
        raise InputError(f"cannot be decoded: {printable(str(error) or type(error).__name__, 120)}") from error


def _bytes(file: ImageFile, config: PictureConfig) -> bytes:
    path = file.root / file.path
    try:
        is_file = path.is_file()
        size = path.stat().st_size if is_file else 0
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be opened: {error}") from error
    if not is_file or not inside(file.root, path):
        raise InputError("is no longer a file in its folder" if is_file else "is not there any more")
    if size > config.file_bytes:
        raise InputError(f"has {size:,} bytes, more than {config.file_bytes:,}")
    return read_raw(path, file.root)


def _small(raw: bytes, side: int, config: PictureConfig) -> Image:
    """Decoded, upright, in RGB, and no larger than `side`; the size is checked before anything is decoded."""
    from PIL import Image, ImageOps

    with Image.open(BytesIO(raw), formats=FORMATS) as image:
        width, height = image.size
        if width * height > config.pixels:
            raise InputError(f"has {width:,} × {height:,} pixels, more than {config.pixels:,}")
        image.draft("RGB", (side, side))
        upright = ImageOps.exif_transpose(image)
        plain = _plain(upright)
        plain.thumbnail((side, side))
        return plain


def _plain(image: Image) -> Image:
    """An image in RGB: 16 bits scaled down to 8, transparency on white."""
    from PIL import Image

    if image.mode.startswith("I") or image.mode == "F":
        low, high = (float(v) for v in image.convert("F").getextrema())  # type: ignore[arg-type]
        full = 65_535.0 if 255 < high <= 65_535 and low >= 0 else max(high, 255.0)
        return image.convert("F").point(lambda v: v * (255.0 / full)).convert("L").convert("RGB")
    if "A" in image.getbands() or "transparency" in image.info:
        clear = image.convert("RGBA")
        return Image.alpha_composite(Image.new("RGBA", clear.size, "white"), clear).convert("RGB")
    return image.convert("RGB")


def _encoded(image: Image, quality: int) -> str:
    out = BytesIO()
    image.save(out, "JPEG", quality=quality, optimize=True)
    return f"data:image/jpeg;base64,{base64.b64encode(out.getvalue()).decode()}"


def _check_pillow() -> None:
    try:
        import PIL  # noqa: F401
    except ModuleNotFoundError as error:
        raise ConfigError("the package Pillow is not installed", repair="pip install 'erag[report]'") from error


def _shortened(issues: Sequence[Issue]) -> Iterable[Issue]:
    yield from issues[:_LISTED]
    if (more := len(issues) - _LISTED) > 0:
        yield Issue("images", f"{more:,} more cannot be read", "not shown")


def _left_out(count: int, config: PictureConfig) -> Iterable[Issue]:
    if count:
        yield Issue("images", f"{count:,} would make the page larger than {config.total_bytes:,} bytes", "not shown")
