"""The comparison: trials judge what they should, cells are kept, the verdict follows its rule."""

import csv
import json
import threading
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from erag.cli.main import run
from erag.compare.cells import Cell, Job, measured, read_cell
from erag.compare.choosing import Decisions, Relevance, Search
from erag.compare.config import CompareConfig, DecisionsTrial, RelevanceTrial, SearchTrial, WorldsConfig
from erag.compare.cosine import Cosine
from erag.compare.plot import apart, plotted
from erag.compare.rows import Row, pareto, verdict
from erag.compare.run import compare, write
from erag.compare.seeing import Captions, Objects
from erag.compare.sizes import model_mb
from erag.compare.telling import ClusterSummaries
from erag.compare.trial import Asked, Judgement, each, shifted
from erag.compare.trials import trial_of
from erag.core.errors import BadModelOutput, ConfigError
from erag.evaluate.statistics import Interval
from erag.lm.checkpoints import shipped
from erag.lm.config import BackendConfig
from erag.lm.fake import Fake, FakeConfig
from erag.lm.openai.server import ServerConfig
from erag.lm.roles import ROLES, SelectTask
from erag.lm.student import StudentConfig
from erag.lm.tagger import TaggerConfig
from erag.lm.weights import default_store
from erag.pipeline.config import validate
from erag.pipeline.serving import openai_server
from erag.study.decisions import Part

FAKE = {"fake": {"model": {"kind": "fake"}}, "wide": {"model": {"kind": "fake", "dim": 128}}}
COSINE = {"cosine": {"model": {"kind": "fake"}, "cosine": True}}


def config(out: Path, **trials: Any) -> CompareConfig:
    raw = {"out": out, "judge": {"kind": "fake"}, "backends": {**FAKE, **COSINE}, "trials": trials}
    return validate(CompareConfig, raw, "test")


SAMPLE = {
    "search": {"kind": "search", "count": 12, "backends": ["fake", "wide"]},
    "relevance": {"kind": "relevance", "count": 6, "backends": ["fake", "cosine"]},
    "answers": {"kind": "answers", "count": 2, "backends": ["fake"]},
}


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> tuple[CompareConfig, list[Row]]:
    """The sample's labels, asked of backends without weights."""
    made = config(tmp_path_factory.mktemp("compare") / "run", **SAMPLE)
    return made, compare(made, default_store(), lambda text: None)


def row(rows: Sequence[Row], trial: str, backend: str) -> Row:
    return next(r for r in rows if (r.trial, r.backend) == (trial, backend))


def test_every_backend_and_control_has_a_row(compared: tuple[CompareConfig, list[Row]]) -> None:
    _, rows = compared
    assert [(r.trial, r.backend, r.kind) for r in rows] == [
        ("search", "cloud", "cloud"), ("search", "fake", "local"), ("search", "wide", "local"),
        ("search", "any, by chance", "control"),
        ("relevance", "cloud", "cloud"), ("relevance", "fake", "local"), ("relevance", "cosine", "local"),
        ("relevance", "longer texts first", "control"),
        ("answers", "cloud", "cloud"), ("answers", "fake", "local"),
        ("answers", "the counts alone, by code", "control"), ("answers", "a generic sentence", "control"),
    ]  # fmt: skip
    for one in rows:
        if one.kind == "cloud":
            assert (one.judgement, one.note) == (None, "no record exists: against labels")
            continue
        assert one.judgement is not None
        assert one.against == "labels"
        assert one.judgement.loss.mean == pytest.approx(1 - one.judgement.figure.mean)
        assert one.judgement.figure.low <= one.judgement.figure.mean <= one.judgement.figure.high
    assert row(rows, "relevance", "fake").judgement.figure.mean > 0.6  # type: ignore[union-attr]


def test_measurements_are_of_a_process_of_their_own(compared: tuple[CompareConfig, list[Row]]) -> None:
    _, rows = compared
    for one in rows:
        if one.kind == "local":
            assert one.cell is not None
            assert 20 < one.cell.base_mb <= one.cell.peak_mb < 4000
            assert one.cell.seconds > 0
            assert len(one.cell.outputs) == one.items
            asked = {"search": 12 + 62}.get(one.trial, one.items)  # queries, and the texts of the sample
            assert one.seconds == pytest.approx(one.cell.seconds / asked)
        else:
            assert (one.seconds, one.peak_mb) == (None, None)
    answers = row(rows, "answers", "fake").judgement
    assert answers is not None
    assert list(answers.more) == ["valid", "grounded", "golden facts stated"]
    assert answers.more["valid"].mean == 1  # the fake's text is of the schema, and says nothing


def test_results_are_written_and_fit_a_terminal(compared: tuple[CompareConfig, list[Row]]) -> None:
    made, rows = compared
    page = (made.out / "report.md").read_text()
    assert "## search (embed): P@1, 12 items, no cloud record: against labels" in page
    assert "1 GiB | 2 GiB | 4 GiB | 8 GiB" in page
    table = list(csv.DictReader((made.out / "table.csv").open()))
    assert [(r["trial"], r["backend"]) for r in table] == [(r.trial, r.backend) for r in rows]
    assert validate(CompareConfig, yaml.safe_load((made.out / "config.yaml").read_text()), "saved") == made


def test_finished_cells_are_kept_and_changed_ones_measured_anew(compared: tuple[CompareConfig, list[Row]]) -> None:
    made, rows = compared
    said: list[str] = []
    again = compare(made, default_store(), said.append)
    assert all(line.endswith(": kept") for line in said)
    assert len(said) == 5
    assert [r.cell for r in again] == [r.cell for r in rows]
    trial = made.trials["search"].model_copy(update={"backends": ("fake",)})
    items = list(Search(trial).items)  # type: ignore[arg-type]
    more = Job("search", "fake", made.model_copy(update={"threads": 1}), items, default_store().files)
    cell, kept = measured(more, made.out / "cells", default_store())
    assert not kept
    assert cell.outputs == row(rows, "search", "fake").cell.outputs  # type: ignore[union-attr]


def test_a_damaged_cell_is_no_cell(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    for text in ("", "{", "[]", '{"trial": "x"}', '{"unknown": 1}'):
        path.write_text(text)
        assert read_cell(path) is None


def test_what_cannot_be_measured_says_why(tmp_path: Path) -> None:
    gone = {"kind": "captions", "source": str(tmp_path / "none"), "backends": ["fake"]}
    trials = {"gone": gone, "search": {"kind": "search", "count": 3, "backends": ["cosine", "fake"]}}
    said: list[str] = []
    rows = compare(config(tmp_path / "out", **trials), default_store(), said.append)
    assert [(r.trial, r.kind, r.judgement is None) for r in rows][:4] == [
        ("gone", "none", True), ("search", "cloud", True), ("search", "local", True), ("search", "local", False),
    ]  # fmt: skip
    assert "cannot play this role" in row(rows, "search", "cosine").note
    assert "not measured" in said[0]
    assert "cannot play this role" in (tmp_path / "out" / "report.md").read_text()


def made_row(name: str, loss: float, seconds: float, mb: float, spread: float = 0.05) -> Row:
    figure = Interval(1 - loss, 1 - loss - spread, 1 - loss + spread)
    judgement = Judgement(figure, Interval(loss, loss - spread, loss + spread))
    cell = Cell("t", name, "d", seconds=seconds * 10, peak_mb=mb, file_mb=100.0)
    return Row("t", "select", name, "local", "agreement", "labels", 10, judgement, 10, cell)


ROWS = [
    made_row("tiny", 0.40, 0.01, 500), made_row("small", 0.22, 0.1, 1800), made_row("large", 0.20, 2.0, 3900),
    made_row("huge", 0.05, 9.0, 9000),
]  # fmt: skip


def test_the_verdict_is_the_fastest_that_cannot_be_told_from_the_best_that_fits() -> None:
    assert verdict(ROWS, "t", 0.25).row is None
    found = {gib: verdict(ROWS, "t", gib) for gib in (1, 2, 4, 16)}
    assert {gib: v.row.backend for gib, v in found.items() if v.row} == {1: "tiny", 2: "small", 4: "small", 16: "huge"}
    assert found[4].best is not None
    assert found[4].best.backend == "large"
    assert found[4].fitting == 3


def test_the_front_has_what_no_other_beats() -> None:
    beaten = made_row("slow and bad", 0.5, 5.0, 100)
    assert [r.backend for r in pareto([beaten, *ROWS])] == ["tiny", "small", "large", "huge"]


def test_the_page_tells_the_rule_and_the_plot_is_drawn(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    made = config(tmp_path, search=SAMPLE["search"])
    hostile = made_row("a | b", 0.3, 0.2, 700)
    control = Row("t", "select", "chance", "control", "agreement", "labels", 10, ROWS[0].judgement)
    write(made, [*ROWS, hostile, control])
    page = (tmp_path / "report.md").read_text()
    assert "small (as good as large, faster)" in page
    assert "chance: 0.40, beaten" in page
    assert "none fits" not in page
    assert "| a / b |" in page
    assert pillow.open(tmp_path / "pareto.png").size[0] > 400
    assert not plotted([control], tmp_path / "none.png")


class Stubborn(Fake):
    """Fails at every batch that holds the word `bad`."""

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        if any("bad" in task.query for task in tasks):
            raise BadModelOutput("no")
        return super().select(tasks, k)


def test_one_item_costs_no_other_its_output() -> None:
    tasks = [SelectTask(q, ("a", "b")) for q in ("a", "bad", "b", "a")]
    assert each(lambda some: Stubborn().select(some, 1), tasks, 3) == [[0], None, [1], [0]]


def retrieval_qa(folder: Path, decisions: Sequence[tuple[str, Sequence[str], str]]) -> Path:
    folder.mkdir()
    lines = []
    for query, names, choice in decisions:
        listed = "\n\n".join(f"{i}. {name}" for i, name in enumerate(names, 1))
        asked = f"Query: {query}\nContext: Available:\n\n{listed}\nInstruction: choose"
        lines.append(json.dumps({"messages": [{"role": "user", "content": asked}, {"content": choice}]}))
    (folder / "train.jsonl").write_text("\n".join(lines))
    return folder


def test_agreement_is_with_the_cards_text(tmp_path: Path) -> None:
    source = retrieval_qa(
        tmp_path / "qa",
        [("Where is the pond?", ("pond_1", "bench_1", "bench_2"), "bench_2"), ("A bench?", ("bench_1", "bin"), "bin"),
         ("Alone?", ("bin",), "bin")],
    )  # fmt: skip
    trial = Decisions(DecisionsTrial(kind="decisions", source=source, backends=("x",), part=Part(folds=1)))
    assert [item["chosen"] for item in trial.items] == [2, 1]  # one card is no choice
    judgement = trial.judge([1, 0], Fake())  # bench_1 reads as bench_2 does
    assert (judgement.figure.mean, judgement.loss.mean) == (0.5, 0.5)
    assert [f.mean for f in judgement.more.values()] == [0.5, 0.0]  # agreeing in words, with another card
    assert trial.judge([None, None], Fake()).figure.mean == 0
    assert trial.judge(trial.cloud(), Fake()).loss.mean == 0
    assert trial.ask(Asked(Fake()), trial.items) == [0, 0]  # type: ignore[arg-type]


def test_recorded_and_far_backends_are_compared_like_any_other(tmp_path: Path) -> None:
    """The cloud's records through `replay` agree with themselves; a server's model answers as the model does."""
    made = [("Where is the pond?", ("pond_1", "bench_1"), "bench_1"), ("A bench?", ("bench_1", "bin"), "bin")]
    source, calls = retrieval_qa(tmp_path / "qa", made), tmp_path / "calls.jsonl.gz"
    assert run(["records", "reference", str(source), "--out", str(calls)]) == 0
    roles = BackendConfig.model_validate({"models": {"f": {"kind": "fake"}}, "roles": dict.fromkeys(ROLES, "f")})
    server = openai_server(roles, default_store(), ServerConfig(port=0))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    far = {"kind": "openai", "model": "f", "base_url": server.url, "key_env": None, "structured": "full"}
    backends = {**FAKE, "recorded": {"model": {"kind": "replay", "records": calls}}, "far": {"model": far}}
    trials = {
        "decisions": {"kind": "decisions", "source": source, "part": {"folds": 1}, "backends": ["recorded", "fake"]},
        "search": {"kind": "search", "count": 4, "backends": ["far", "fake"]},
    }
    raw = {"out": tmp_path / "out", "judge": {"kind": "fake"}, "backends": backends, "trials": trials}
    try:
        rows = compare(validate(CompareConfig, raw, "test"), default_store(), lambda text: None)
    finally:
        server.stop()
        thread.join(timeout=10)
    said = {(r.trial, r.backend): r.cell.outputs for r in rows if r.cell}
    assert said["decisions", "recorded"] == [1, 1]
    assert said["search", "far"] == said["search", "fake"]
    losses = {r.backend: r.judgement.loss.mean for r in rows if r.trial == "decisions" and r.judgement}
    assert (losses["cloud teacher (recorded)"], losses["recorded"], losses["fake"]) == (0, 0, 1)


def test_relevance_is_the_area_under_the_roc() -> None:
    trial = Relevance(RelevanceTrial(kind="relevance", backends=("x",), count=3, relevant=1, others=2))
    perfect, worst, tied = [0.9, 0.1, 0.2], [0.1, 0.2, 0.3], [0.5, 0.5, 0.5]
    assert trial.judge([perfect, worst, tied], Fake()).figure.mean == pytest.approx(0.5)
    assert trial.judge([[None, 0.1, 0.2]] * 3, Fake()).figure.mean == 0
    assert all(len(item["relevant"]) == 1 and len(item["others"]) == 2 for item in trial.items)


def test_a_pool_keeps_something_to_find() -> None:
    trial = Search(SearchTrial(kind="search", backends=("x",), count=5, pool=20))
    (found,) = {len(output) for output in trial.ask(Asked(Fake()), trial.items)}  # type: ignore[arg-type]
    assert found == 5
    assert all(item["relevant"] for item in trial.items)
    right = [[item["relevant"][0], "x"] for item in trial.items]
    assert trial.judge(right, Fake()).figure.mean == 1
    assert trial.judge(right, Fake()).more["P@5"].mean == pytest.approx(0.2)


def test_cosine_selects_and_scores() -> None:
    fake = Fake()
    cosine = Cosine(fake, fake)
    assert cosine.select([SelectTask("a bench", ("a pond", "", "a bench"))], 2) == [[2, 0]]
    scores = cosine.score([("a bench", "a bench"), ("a bench", "")])
    assert scores == pytest.approx([1, 0], abs=1e-6)
    assert cosine.select([], 1) == []


GML = """graph [
  node [ id 0 label "0" type "base" position [ x 8.0 y 47.0 z 0 ] name "a" caption "A bench stands by a pond." level 0 ]
  node [ id 1 label "1" type "base" position [ x 8.0 y 47.1 z 0 ] name "b" caption "A red bench by a tree." level 0 ]
  node [ id 2 label "2" type "base" position [ x 8.0 y 47.1 z 0 ] name "c" caption "A car on a road." level 0 ]
  node [ id 3 label "3" type "base" position [ x 8.0 y 47.1 z 0 ] name "d" caption "A car by a house." level 0 ]
  node [ id 4 label "p" type "cluster" position [ x 8 y 47 z 0 ] name "Benches" summary "Benches by a pond." level 1
    members "0" members "1" ]
  node [ id 5 label "q" type "cluster" position [ x 8 y 47 z 0 ] name "Cars" summary "Cars and dragons." level 1
    members "2" members "3" ]
]"""


def test_summaries_are_held_against_the_clouds_own_of_the_same_cluster(tmp_path: Path) -> None:
    (tmp_path / "f.gml").write_text(GML)
    raw = {"kind": "summaries", "source": tmp_path / "f.gml", "backends": ["fake"]}
    trial = trial_of(config(tmp_path / "out", summaries=raw), "summaries", default_store())
    assert isinstance(trial, ClusterSummaries)
    ours = trial.judge(trial.ask(Asked(Fake()), trial.items), Fake())  # type: ignore[arg-type]
    cloud = trial.judge(trial.cloud(), Fake())
    assert cloud.loss.mean == pytest.approx(0, abs=1e-6)
    assert 0 < ours.loss.mean < 1
    assert cloud.more["facts mentioned"].mean > 0.2
    # no member bears out dragons: one of the two statements of its cluster
    assert cloud.more["statements unsupported"].mean == pytest.approx(0.25)
    controls = trial.controls()
    assert trial.judge(controls["of another cluster"], Fake()).figure.mean < cloud.figure.mean
    assert "bench" in json.dumps(controls["composed by code"]).lower()


def test_captions_are_held_against_the_clouds(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    (tmp_path / "frames").mkdir()
    nodes = []
    for i, text in enumerate(("A lobby with a desk.", "A road with a car.")):
        pillow.fromarray(np.full((8, 8, 3), 40 * i, np.uint8)).save(tmp_path / "frames" / f"{i}.png")
        said = json.dumps({"Description": text, "Objects": "desk, car"})
        nodes.append({"node_id": i, "position": [i, 0, 0], "image": f"frames/{i}.png", "caption": said})
    (tmp_path / "nodes_with_captions.json").write_text(json.dumps(nodes))
    raw = {"kind": "captions", "source": tmp_path, "backends": ["fake"]}
    trial = trial_of(config(tmp_path / "out", frames=raw), "frames", default_store())
    assert isinstance(trial, Captions)
    assert trial.judge(trial.cloud(), Fake()).figure.mean == pytest.approx(1)
    other = trial.judge(trial.controls()["a caption of another frame"], Fake())
    assert other.figure.mean < 1
    assert trial.judge(trial.ask(Asked(Fake()), trial.items), Fake()).loss.mean > other.loss.mean  # type: ignore[arg-type]
    assert trial.judge([None, None], Fake()).figure.mean == 0


TRUTH = [
    {"node": f"n{i}", "place": "park", "caption": "x", "objects": [
        {"name": name, "share": 0.2, "box": [0, 0, 1, 1]} for name in names]}
    for i, names in enumerate((("litter bin", "bench"), ("bench",)))
]  # fmt: skip


def test_objects_are_counted_by_class_and_synonym(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    (tmp_path / "truth").mkdir()
    (tmp_path / "worlds" / "park").mkdir(parents=True)
    (tmp_path / "worlds" / "park" / "meta.json").touch()
    (tmp_path / "truth" / "park.jsonl").write_text("\n".join(map(json.dumps, TRUTH)))
    raw = {"kind": "objects", "synonyms": {"litter bin": ["waste bin"]}, "backends": ["fake"]}
    made = config(tmp_path / "out", objects=raw)
    worlds = WorldsConfig(folder=tmp_path, names=("park",))
    trial = trial_of(made.model_copy(update={"worlds": worlds}), "objects", default_store())
    assert isinstance(trial, Objects)
    listed = [{"text": "", "objects": ["waste bin", "dragon"]}, {"text": "Two benches? One bench.", "objects": []}]
    precision, recall = trial.judge(listed, Fake()).more.values()
    assert (precision.mean, recall.mean) == (1, pytest.approx(2 / 3))  # a dragon is no class
    assert trial.judge([None, None], Fake()).figure.mean == 0
    assert trial.controls()["the 5 commonest classes"][0]["objects"] == ["bench", "litter bin"]


def test_losses_are_item_by_item() -> None:
    judged = Judgement.of([1.0, 0.5])
    assert (judged.figure.mean, judged.loss.mean, judged.loss.low) == (0.75, 0.25, 0.0)
    assert judged.against(Judgement.of([0.5, 0.5])).loss.mean == -0.25  # better than what it is held against
    assert shifted([1, 2, 3]) == [2, 3, 1]


def test_sizes_are_those_of_the_files() -> None:
    store = default_store()
    expected = (store.manifest("efficientnet-lite0").bytes or 0) / 1e6
    assert model_mb([TaggerConfig(), TaggerConfig()], store) == pytest.approx(expected)  # a file counts once
    assert model_mb([FakeConfig()], store) is None
    student = shipped("captioner.safetensors").stat().st_size / 1e6
    assert model_mb([StudentConfig(), TaggerConfig()], store) == pytest.approx(expected + student)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    raw = {"out": str(tmp_path / "out"), "judge": {"kind": "fake"}, "backends": FAKE,
           "trials": {"search": {"kind": "search", "count": 3, "backends": ["fake"]}}}  # fmt: skip
    (tmp_path / "c.yaml").write_text(yaml.safe_dump(raw))
    assert run(["compare", "--config", str(tmp_path / "c.yaml"), "--set", "threads=1"]) == 0
    out = capsys.readouterr().out
    assert "search (embed): P@1" in out
    assert "report.md" in out


@pytest.mark.parametrize(
    ("trials", "told"),
    [
        ({"s": {"kind": "search", "backends": ["nobody"]}}, "names 'nobody', which is no backend"),
        ({"d": {"kind": "decisions", "source": "x", "backends": ["fake"], "part": {"number": 5}}}, "part 5 of 5"),
        ({"m": {"kind": "memories", "systems": ["nobody"]}}, "names 'nobody', which is no system"),
        ({"m": {"kind": "memories", "systems": ["tiny"], "cloud": "GPT"}}, "memory of a reference"),
        ({"x": {"kind": "cook", "backends": ["fake"]}}, "cook"), ({}, "trials"),
    ],
)  # fmt: skip
def test_configurations_that_cannot_work_are_refused(tmp_path: Path, trials: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        config(tmp_path, **trials)


@pytest.mark.parametrize("path", sorted((Path(__file__).parents[2] / "configs" / "compare").glob("*.yaml")))
def test_shipped_comparisons_parse(path: Path) -> None:
    text = path.read_text()
    validate(CompareConfig, yaml.safe_load(text), str(path))
    assert text.startswith("# erag compare --config configs/compare/")


def test_names_of_a_plot_lie_apart_and_within() -> None:
    assert apart([0.2, 0.5, 0.9], 0.1) == [0.2, 0.5, 0.9]
    for places in ([0.5] * 5, [0.0] * 5, [1.0] * 5, [0.1, 0.11, 0.98, 0.99, 1.0]):
        found = apart(places, 0.1)
        assert min(b - a for a, b in pairwise(found)) > 0.1 - 1e-9
        assert 0.04 < found[0] <= found[-1] < 0.96
    crowded = apart([0.5] * 40, 0.1)
    assert min(b - a for a, b in pairwise(crowded)) == pytest.approx(1 / 40)
    assert apart([], 0.1) == []
