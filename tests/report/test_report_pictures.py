"""Images: shown small, bounded, upright; broken and hostile ones are reported and the rest goes on."""

import base64
import struct
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from report_worlds import MakeMemory, MakePage, parse, places

from erag.report.config import PictureConfig
from erag.report.pictures import ImageFile, Pictures, thumbnails

CONFIG = PictureConfig()


def noise(width: int, height: int, seed: int = 0) -> Image.Image:
    return Image.fromarray(np.random.default_rng(seed).integers(0, 255, (height, width, 3), np.uint8))


def opened(picture: str) -> Image.Image:
    assert picture.startswith("data:image/jpeg;base64,")
    return Image.open(BytesIO(base64.b64decode(picture.partition(",")[2])))


def made(root: Path, *names: str, config: PictureConfig = CONFIG) -> Pictures:
    return thumbnails([ImageFile(row, root, name) for row, name in enumerate(names)], config)


def png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds nothing."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(b"\0" * 100))
        + chunk(b"IEND", b"")
    )


def test_thumbnails_are_small_and_keep_their_shape(tmp_path: Path) -> None:
    noise(1600, 900).save(tmp_path / "wide.jpg")
    noise(90, 160).save(tmp_path / "small.png")
    pictures = made(tmp_path, "wide.jpg", "small.png")
    assert opened(pictures.by_row[0]).size == (360, 203)
    assert opened(pictures.by_row[1]).size == (90, 160)
    assert pictures.issues == ()
    assert made(tmp_path, "wide.jpg", "small.png") == pictures


def test_modes_a_browser_does_not_show_become_rgb(tmp_path: Path) -> None:
    noise(64, 64).convert("CMYK").save(tmp_path / "cmyk.jpg")
    Image.fromarray(np.full((64, 64), 40_000, np.uint16)).save(tmp_path / "deep.png")
    Image.new("RGBA", (64, 64), (255, 0, 0, 0)).save(tmp_path / "clear.png")
    Image.new("P", (64, 64), 3).save(tmp_path / "palette.png")
    noise(64, 64).save(tmp_path / "really-a-png.jpg", format="PNG")
    pictures = made(tmp_path, "cmyk.jpg", "deep.png", "clear.png", "palette.png", "really-a-png.jpg")
    assert pictures.issues == ()
    assert {opened(p).mode for p in pictures.by_row.values()} == {"RGB"}
    assert opened(pictures.by_row[1]).getpixel((5, 5))[0] == pytest.approx(40_000 * 255 / 65_535, abs=2)
    assert opened(pictures.by_row[2]).getpixel((5, 5)) == pytest.approx((255, 255, 255), abs=2)


def test_an_image_that_was_held_sideways_stands_upright(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    noise(80, 40).save(tmp_path / "turned.jpg", exif=exif)
    assert opened(made(tmp_path, "turned.jpg").by_row[0]).size == (40, 80)


def test_broken_and_hostile_files_are_reported_and_the_rest_goes_on(tmp_path: Path) -> None:
    noise(200, 200).save(tmp_path / "good.jpg")
    raw = (tmp_path / "good.jpg").read_bytes()
    files = {
        "cut.jpg": raw[: len(raw) // 2], "empty.jpg": b"", "text.jpg": b"<script>alert(1)</script>",
        "bomb.png": png_header(50_000, 50_000), "lies.png": png_header(100, 100),
        "vector.svg": b'<svg xmlns="http://www.w3.org/2000/svg" onload="alert(1)"/>', "head.jpg": raw[:20],
    }  # fmt: skip
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder.jpg").mkdir()
    outside = tmp_path / "root"
    outside.mkdir()
    (outside / "out.jpg").symlink_to(tmp_path / "good.jpg")
    pictures = made(tmp_path, *files, "folder.jpg", "gone.jpg", "good.jpg")
    assert list(pictures.by_row) == [len(files) + 2]
    what = {issue.where: issue.what for issue in pictures.issues}
    assert set(what) == {*files, "folder.jpg", "gone.jpg"}
    assert "2500000000 pixels" in what["bomb.png"]
    assert "not there any more" in what["gone.jpg"]
    (leading_out,) = made(outside, "out.jpg").issues
    assert "no longer a file in its folder" in leading_out.what


def test_files_above_the_limits_are_not_decoded(tmp_path: Path) -> None:
    noise(200, 200).save(tmp_path / "big.png")
    (by_bytes,) = made(tmp_path, "big.png", config=PictureConfig(file_bytes=1000)).issues
    (by_pixels,) = made(tmp_path, "big.png", config=PictureConfig(pixels=1000)).issues
    assert "more than 1,000" in by_bytes.what
    assert "200 × 200 pixels, more than 1,000" in by_pixels.what


def test_all_thumbnails_together_stay_below_the_limit(tmp_path: Path) -> None:
    for i in range(8):
        noise(120, 120, i).save(tmp_path / f"{i}.png")
    names = [f"{i}.png" for i in range(8)]
    size = len(made(tmp_path, "0.png").by_row[0])
    pictures = made(tmp_path, *names, config=PictureConfig(total_bytes=size * 3 + size // 2))
    assert list(pictures.by_row) == [0, 1, 2]
    assert pictures.issues[0].what.startswith("5 would make the page larger")
    smaller = made(tmp_path, *names, config=PictureConfig(side=120, full_size=2, least_side=20))
    assert opened(smaller.by_row[0]).size == (60, 60)


def test_many_broken_images_are_not_listed_one_by_one(tmp_path: Path) -> None:
    issues = made(tmp_path, *(f"gone{i}.jpg" for i in range(50))).issues
    assert len(issues) == 21
    assert "30 more cannot be read" in issues[-1].what


def test_images_of_a_memory_are_in_its_page(tmp_path: Path, make_memory: MakeMemory, make_page: MakePage) -> None:
    folder = tmp_path / "world" / "images"
    folder.mkdir(parents=True)
    rows = places(6)
    for i, row in enumerate(rows):
        noise(64, 48, i).save(folder / f"{i}.jpg")
        row["image"] = f"images/{i}.jpg"
    memory = make_memory(rows)
    (folder / "4.jpg").write_bytes(b"no image any more")
    (folder / "5.jpg").unlink()
    page = make_page(memory, ["a bench"])
    parsed = parse(page.html)
    assert sorted(parsed.data["pictures"]) == ["0", "1", "2", "3"]
    assert "4 of 6 shown" in parsed.shown
    assert "images/4.jpg : cannot be decoded" in parsed.shown
    assert {issue.where for issue in page.issues} == {"images/4.jpg", "images/5.jpg"}


def test_the_images_of_hits_come_first(tmp_path: Path, make_memory: MakeMemory, make_page: MakePage) -> None:
    folder = tmp_path / "world" / "images"
    folder.mkdir(parents=True)
    rows = places(12)
    for i, row in enumerate(rows):
        noise(64, 48, i).save(folder / f"{i}.jpg")
        row["image"] = f"images/{i}.jpg"
    page = parse(make_page(make_memory(rows), ["a fire hydrant"], pictures=PictureConfig(total_bytes=10_000)).html)
    hits = {str(row) for row in page.data["questions"][0]["hits"]}
    shown = set(page.data["pictures"])
    assert shown
    assert shown < hits
