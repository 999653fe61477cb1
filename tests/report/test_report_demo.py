"""The demo in a rendered world, with models that need no weights; its page in a browser."""

import json
import re
from pathlib import Path

import pytest
from report_browser import browse
from report_worlds import parse

from erag.cli.main import run
from erag.lm.student_checkpoint import shipped

pytest.importorskip("pybullet", reason="needs erag[sim]")
FAKE = (
    "--set", "backend.models={fake: {kind: fake}}", "--set", "backend.roles={embed: fake, caption: fake}",
    "--set", "answer={}", "--set", "retrieve={}",
)  # fmt: skip


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a demo. Read only."""
    folder = tmp_path_factory.mktemp("demo") / "out"
    assert run(["demo", "--out", str(folder), "--world", "house", "--size", "48x36", *FAKE]) == 0
    return folder


def test_the_page_shows_images_answers_and_a_route_over_both_visits(out: Path) -> None:
    page = (out / "report.html").read_text("utf-8")
    assert len(re.findall("data:image/jpeg", page)) == 112
    assert not re.search(r"""(?:src|href)=["']?https?:""", page)
    shown = parse(page).shown
    lines = (out / "world" / "queries.jsonl").read_text("utf-8").splitlines()
    asked = {kind: [q for q in map(json.loads, lines) if q["kind"] == kind] for kind in ("explicit", "global")}
    assert asked["explicit"][0]["query"] in shown
    assert next(q["query"] for q in asked["global"] if q["task"] == "describe") in shown


def test_the_page_runs_in_a_browser(chromium: str, out: Path, tmp_path: Path) -> None:
    done = browse(chromium, tmp_path, "--dump-dom", (out / "report.html").as_uri())
    assert "CONSOLE" not in done.stderr, done.stderr
    assert len([a for a in parse(done.stdout).with_attribute("class", "circle") if a["class"].split() == ["on"]]) == 5


def test_it_goes_on_from_what_is_there(out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--out", str(out), "--world", "house", "--size", "48x36", *FAKE]) == 0
    said = capsys.readouterr().out
    assert "the forest is up to date" in said
    assert "P@1" in said


@pytest.mark.skipif(shipped().is_file(), reason="the student's checkpoint is here")
def test_without_the_student_one_line_says_how_to_make_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "erag distil --config configs/distil/captioner.yaml" in said
    assert not (tmp_path / "out").exists()
