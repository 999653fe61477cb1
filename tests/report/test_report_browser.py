"""The page in a headless browser, where there is one: its script runs under its policy, and draws."""

from pathlib import Path

import numpy as np
from PIL import Image
from report_browser import browse
from report_worlds import HOSTILE, MakeMemory, MakePage, parse, places


def test_the_script_runs_and_selects_the_first_answer(
    chromium: str, campus: Path, make_page: MakePage, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    page.write_text(make_page(campus, ["a fire hydrant"], at=(1.122801, 52.410072)).html)
    done = browse(chromium, tmp_path, "--dump-dom", page.as_uri())
    assert "CONSOLE" not in done.stderr, done.stderr
    dom = parse(done.stdout)
    by_id = {a["id"]: a for a in dom.with_attribute("id")}
    assert by_id["way"]["d"].startswith("M")
    assert by_id["goal"]["d"].startswith("M")
    assert "hidden" not in by_id["clear"]
    assert len([a for a in dom.with_attribute("class", "circle") if a["class"].split() == ["on"]]) == 5
    assert "fire hydrant" in dom.shown
    assert by_id["map"]["viewbox"] != "0 0 10800 9032"


def test_hostile_text_runs_nothing_and_asks_for_nothing(
    chromium: str, make_memory: MakeMemory, make_page: MakePage, tmp_path: Path
) -> None:
    rows = places(8, name=HOSTILE)
    for row in rows:
        row["caption"] = f"{row['caption']} {HOSTILE}"
    page = tmp_path / "page.html"
    page.write_text(make_page(make_memory(rows), [f"a bench {HOSTILE}"]).html)
    log = tmp_path / "net.json"
    done = browse(chromium, tmp_path, f"--log-net-log={log}", "--dump-dom", page.as_uri())
    assert "CONSOLE" not in done.stderr, done.stderr
    assert "evil.example" not in log.read_text()
    assert not [a for a in parse(done.stdout).with_attribute("onerror")]


def test_it_is_drawn_in_colour(chromium: str, campus: Path, make_page: MakePage, tmp_path: Path) -> None:
    page, shot = tmp_path / "page.html", tmp_path / "shot.png"
    page.write_text(make_page(campus).html)
    browse(chromium, tmp_path, "--window-size=1200,800", f"--screenshot={shot}", page.as_uri())
    with Image.open(shot) as image:
        pixels = np.asarray(image.convert("RGB"), np.int16)[250:700, 40:640]
    vivid = (pixels.max(axis=2) - pixels.min(axis=2)) > 60
    assert 0.002 < vivid.mean() < 0.3
