"""Image files that are broken, hostile or unusual: each is refused with a reason or converted as it should be."""

import io
import os
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.lm.images import MAX_BYTES, BadImages, load, load_all, resized, sift


def _gradient(width: int = 40, height: int = 30) -> np.ndarray:
    """(h, w, 3) colours that differ in every direction, so that a turn or a swap shows."""
    x, y = np.meshgrid(np.linspace(0, 255, width), np.linspace(0, 255, height))
    return np.stack([x, y, np.full_like(x, 40)], axis=2).astype(np.uint8)


def _png(width: int, height: int, body: bytes = b"") -> bytes:
    """A PNG whose header says `width` × `height`; `body` is its pixel data."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b"")


def _reason(path: Path) -> str:
    with pytest.raises(BadImages) as caught:
        load(path)
    (bad,) = caught.value.bad
    assert bad.path == path
    assert str(path) in caught.value.line()
    return bad.reason


def test_a_plain_image_comes_back_pixel_for_pixel(tmp_path: Path) -> None:
    Image.fromarray(_gradient()).save(tmp_path / "a.png")
    picture = load(tmp_path / "a.png")
    assert np.array_equal(picture.pixels, _gradient())
    assert picture.notes == ()


def test_a_header_of_50000_by_50000_is_refused_before_anything_is_decoded(tmp_path: Path) -> None:
    (tmp_path / "bomb.png").write_bytes(_png(50_000, 50_000, bytes(1000)))
    tracemalloc.start()
    reason = _reason(tmp_path / "bomb.png")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "its header says more than 64,000,000 pixels" in reason
    assert peak < 20_000_000


def test_a_header_above_our_limit_but_below_pillows_is_refused(tmp_path: Path) -> None:
    (tmp_path / "large.png").write_bytes(_png(9_000, 9_000))
    assert "9,000 × 9,000" in _reason(tmp_path / "large.png")


def test_a_long_thin_header_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thin.png").write_bytes(_png(1_000_000, 1))
    assert "1,000,000 × 1" in _reason(tmp_path / "thin.png")


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "tiff"])
def test_a_truncated_file_is_refused(tmp_path: Path, suffix: str) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
    path = tmp_path / f"whole.{suffix}"
    Image.fromarray(noise).save(path)
    load(path)
    cut = tmp_path / f"cut.{suffix}"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert "damaged or cut short" in _reason(cut) or "no image" in _reason(cut)


def test_damage_anywhere_is_refused_or_read_but_never_an_unknown_error(tmp_path: Path) -> None:
    generator = np.random.default_rng(1)
    for kind in ("JPEG", "PNG", "WEBP", "TIFF", "BMP", "PPM"):
        buffer = io.BytesIO()
        Image.fromarray(_gradient()).save(buffer, kind)
        for _ in range(40):
            data = bytearray(buffer.getvalue())
            for at in generator.integers(0, len(data), 6):
                data[at] = generator.integers(256)
            (tmp_path / "x").write_bytes(data)
            try:
                assert load(tmp_path / "x").pixels.ndim == 3
            except BadImages:
                continue


def test_text_empty_missing_folder_pipe_and_link_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.jpg").write_text("<html>not a picture</html>")
    (tmp_path / "empty.png").touch()
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    Image.fromarray(_gradient()).save(tmp_path / "a.png")
    (tmp_path / "link.png").symlink_to(tmp_path / "a.png")
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    assert "no image" in _reason(tmp_path / "text.jpg")
    assert "empty" in _reason(tmp_path / "empty.png")
    assert "no regular file" in _reason(tmp_path / "folder.png")
    assert "no regular file" in _reason(tmp_path / "pipe.png")
    assert "symbolic link" in _reason(tmp_path / "link.png")
    assert "symbolic link" in _reason(tmp_path / "loop.png")
    assert "no such file" in _reason(tmp_path / "absent.png")


def test_a_file_too_large_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "large.png").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    assert "bytes, more than" in _reason(tmp_path / "large.png")


def test_formats_outside_the_list_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.eps").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\nshowpage\n")
    Image.fromarray(_gradient()).save(tmp_path / "a.gif")
    assert "no image" in _reason(tmp_path / "a.eps")
    assert "no image" in _reason(tmp_path / "a.gif")


def test_the_content_decides_and_a_wrong_name_is_noted(tmp_path: Path) -> None:
    Image.fromarray(_gradient()).save(tmp_path / "a.png", "BMP")
    picture = load(tmp_path / "a.png")
    assert np.array_equal(picture.pixels, _gradient())
    assert picture.notes == ("named 'a.png', is BMP",)


def test_cmyk_is_converted(tmp_path: Path) -> None:
    Image.fromarray(_gradient()).convert("CMYK").save(tmp_path / "a.jpg", quality=100, subsampling=0)
    picture = load(tmp_path / "a.jpg")
    assert np.abs(picture.pixels.astype(int) - _gradient()).mean() < 4
    assert picture.notes == ("CMYK made RGB",)


@pytest.mark.parametrize("suffix", ["png", "tiff"])
def test_sixteen_bits_keep_their_range(tmp_path: Path, suffix: str) -> None:
    grey = np.linspace(0, 65_535, 30 * 40).reshape(30, 40).astype(np.uint16)
    Image.fromarray(grey).save(tmp_path / f"a.{suffix}")
    picture = load(tmp_path / f"a.{suffix}")
    assert np.array_equal(picture.pixels[:, :, 1], grey >> 8)
    assert picture.notes == ("16-bit made 8-bit",)


def test_palette_alpha_and_grey(tmp_path: Path) -> None:
    half = np.dstack([_gradient(), np.where(np.arange(40) < 20, 255, 0)[None].repeat(30, 0).astype(np.uint8)])
    Image.fromarray(half, "RGBA").save(tmp_path / "alpha.png")
    alpha = load(tmp_path / "alpha.png")
    assert np.array_equal(alpha.pixels[:, :20], _gradient()[:, :20])
    assert (alpha.pixels[:, 20:] == 255).all()
    assert alpha.notes == ("alpha laid on white",)
    Image.fromarray(_gradient()).quantize(16).save(tmp_path / "palette.png")
    assert load(tmp_path / "palette.png").notes == ("P made RGB",)
    Image.fromarray(_gradient()[:, :, 0]).save(tmp_path / "grey.png")
    assert np.array_equal(load(tmp_path / "grey.png").pixels[:, :, 2], _gradient()[:, :, 0])


def test_floating_point_pixels_are_refused(tmp_path: Path) -> None:
    Image.fromarray(np.random.default_rng(0).random((8, 8)).astype(np.float32)).save(tmp_path / "a.tiff")
    assert "floating-point" in _reason(tmp_path / "a.tiff")


def test_exif_rotation_is_applied(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned a quarter clockwise
    Image.fromarray(_gradient()).save(tmp_path / "a.png", exif=exif)
    picture = load(tmp_path / "a.png")
    assert np.array_equal(picture.pixels, np.rot90(_gradient(), -1))
    assert picture.notes == ("rotated as its EXIF says",)


def test_a_call_names_all_its_bad_images_and_sifting_keeps_the_others(tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.png" for i in range(5)]
    for path in paths:
        Image.fromarray(_gradient()).save(path)
    paths[1].write_bytes(b"x")
    paths[3].unlink()
    with pytest.raises(BadImages) as caught:
        load_all(paths)
    assert [b.path for b in caught.value.bad] == [paths[1], paths[3]]
    good, bad = sift(paths)
    assert good == [paths[0], paths[2], paths[4]]
    assert [b.path for b in bad] == [paths[1], paths[3]]


def test_resizing_averages_what_a_pixel_covers() -> None:
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[:, ::2] = 200
    assert np.abs(resized(stripes, 8, 8).astype(int) - 100).max() <= 2
