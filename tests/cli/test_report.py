"""The `report` command: what it writes, what it says, and what it refuses."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from erag.cli.main import run
from erag.data.sample import sample_queries

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def report(capfd: pytest.CaptureFixture[str], fake_config: Path) -> Run:
    """Runs `erag report` in this process: exit code, stdout, stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        code = run(["report", *map(str, arguments), "--config", str(fake_config)])
        captured = capfd.readouterr()
        return code, captured.out, captured.err

    return call


def data_of(page: Path) -> dict[str, list[dict[str, object]]]:
    text = page.read_text()
    start = text.index('id="data">') + len('id="data">')
    return json.loads(text[start : text.index("</script>", start)])


def test_a_page_of_texts_and_a_file(report: Run, campus: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "page.html"
    asked = ("--ask", "a bench", "--ask", "What is it like here?", "--queries", sample_queries(), "--at-node", "n01")
    code, said, err = report(campus, "--out", out, *asked)
    assert (code, err) == (0, "")
    assert said.startswith(f"{out}: 62 nodes, ")
    assert "42 questions, 0 pictures" in said
    questions = data_of(out)["questions"]
    assert len(questions) == 42
    stated = [False, False, *("at" in json.loads(line) for line in sample_queries().read_text().splitlines())]
    starts = {
        own: {str(q["start"]) for q, o in zip(questions, stated, strict=True) if o == own} for own in (True, False)
    }
    assert starts[False] == {str(data_of(out)["nodes"][0][5:7])}
    assert starts[True]
    assert str(None) not in starts[True]
    assert questions[0]["way"]


def test_a_page_without_questions(report: Run, campus: Path, tmp_path: Path) -> None:
    code, said, _ = report(campus, "--out", tmp_path / "page.html")
    assert code == 0
    assert "0 questions" in said
    assert data_of(tmp_path / "page.html")["questions"] == []


def test_without_seconds_the_bytes_are_the_same(report: Run, campus: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        report(campus, "--out", tmp_path / name, "--ask", "a bench", "--no-seconds")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert b" s \xc2\xb7 " not in (tmp_path / "a").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("no.erag", "--out", "p.html"), "no such memory file"),
        (("M", "--out", "M"), "would be overwritten"),
        (("M", "--out", "Q", "--queries", "Q"), "would be overwritten"),
        (("M", "--out", "."), "is not a regular file"),
        (("M", "--out", "p.html", "--at-node", "n01"), "--at-node without a question"),
        (("M", "--out", "p.html", "--ask", "x", "--at-node", "zz"), "no node 'zz'"),
        (("M", "--out", "p.html", "--queries", "no.jsonl"), "no such file"),
        (("M", "--out", "p.html", "--queries", "E"), "no query"),
        (("M", "--out", "p.html", "--set", "nonsense"), "path=value"),
        (("M",), "--out"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    report: Run, campus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    copy = tmp_path / "copy.erag"
    copy.write_bytes(campus.read_bytes())
    (tmp_path / "q.jsonl").write_text('{"id": "a", "query": "x"}')
    (tmp_path / "e.jsonl").write_text("\n")
    filled = [{"M": str(copy), "Q": "q.jsonl", "E": "e.jsonl"}.get(a, a) for a in arguments]
    code, out, err = report(*filled)
    assert (code, out) == (2, "")
    assert err.startswith("erag: ")
    assert err.count("\n") == 1
    assert said in err
    assert copy.read_bytes() == campus.read_bytes()
