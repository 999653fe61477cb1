"""Data sets: what is read, what is refused, and that one file makes a new one."""

from __future__ import annotations

import json
import types
from pathlib import Path

import pytest

from erag.core.errors import ConfigError, InputError
from erag.data.registry import read
from erag.evaluate.dataset import Dataset, Environment, questions
from erag.evaluate.datasets import catalogue
from erag.evaluate.datasets.catalogue import load_dataset, loaders
from erag.evaluate.truth import NodeTruth, SeenObject
from erag.evaluate.truthfiles import read_truth

META = '{"format": "erag-observations", "version": 1, "name": "w", "frame": "metric"}'
QUERIES = [
    {"id": "q1", "kind": "explicit", "query": "a bench", "relevant": ["n1"], "targets": ["bench"]},
    {"id": "q2", "kind": "global", "query": "what is here?", "golden_answer": "Benches.", "facts": ["a bench"]},
    {"id": "q3", "kind": "unanswerable", "query": "a whale", "relevant": []},
    {"id": "q4", "kind": "explicit", "query": "a tree", "at": [0, 0]},
]
TRUTH = [
    {"node": "n1", "objects": [{"name": "bench", "area": 0.2, "pixels": 77}], "place": "park", "image": "i/1.png"},
    {"node": "n2", "objects": [], "captions": ["A road.", " "], "attributes": ["sunny"]},
    {"node": 3},
]


def lines(path: Path, rows: list[dict]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """A simulated world with three views."""
    folder = tmp_path / "worlds" / "park_01"
    lines(folder / "observations.jsonl", [{"id": f"n{i}", "pose": {"x": i, "y": 0}, "caption": "?"} for i in (1, 2)])
    (folder / "meta.json").write_text(META)
    lines(folder / "truth.jsonl", TRUTH)
    lines(folder / "queries.jsonl", QUERIES)
    return folder


def test_the_sample_needs_nothing() -> None:
    (campus,) = load_dataset("sample").environments
    assert {q.kind for q in campus.questions} >= {"explicit", "implicit", "global"}
    nodes = {o.id for o in read(campus.source).observations}
    assert set(campus.truths.by_node) == nodes
    assert not campus.truths.independent
    assert all(q.relevant is None or q.relevant <= nodes for q in campus.questions)
    assert all((q.golden is not None) == (q.kind == "global") for q in campus.questions)


def test_a_world_is_read_with_its_truth_and_labels(world: Path, tmp_path: Path) -> None:
    (environment,) = load_dataset("simulated", tmp_path).environments
    assert (environment.name, environment.source, environment.split) == ("park_01", world, "test")
    assert environment.truths.independent
    assert environment.truths.of("n1") == NodeTruth(
        "n1", (SeenObject("bench", 0.2),), (), "park", (), world / "i/1.png"
    )
    assert environment.truths.of("n1").texts == ("park, bench.",)
    assert environment.truths.of("n2") == NodeTruth("n2", (), ("A road.",), "", ("sunny",))
    assert environment.truths.of("n2").texts == ("A road.", "sunny.")
    assert environment.truths.of("3").objects is None
    assert environment.truths.of("nowhere") == NodeTruth("nowhere")
    explicit, whole, none, unlabelled = environment.questions
    assert (explicit.relevant, explicit.asked.targets) == (frozenset({"n1"}), frozenset({"bench"}))
    assert whole.golden is not None
    assert (whole.golden.text, whole.golden.facts, whole.relevant) == ("Benches.", ("a bench",), None)
    assert (none.relevant, none.kind) == (frozenset(), "unanswerable")
    assert (unlabelled.relevant, unlabelled.golden, unlabelled.text) == (None, None, "a tree")


def test_questions_may_lie_in_one_file_for_all_worlds(world: Path, tmp_path: Path) -> None:
    (world / "queries.jsonl").unlink()
    shared = tmp_path / "all.jsonl"
    lines(shared, [QUERIES[0] | {"environment": "park_01"}, QUERIES[1] | {"environment": "office_02"}])
    (environment,) = load_dataset("simulated", tmp_path, shared).environments
    assert [q.id for q in environment.questions] == ["q1"]
    with pytest.raises(InputError, match="no such file"):
        load_dataset("simulated", tmp_path)


def test_splits_select(world: Path, tmp_path: Path) -> None:
    dataset = load_dataset("simulated", tmp_path)
    assert dataset.of_split("test") == dataset
    with pytest.raises(InputError, match=r"no environment of split 'train'.*allowed: test"):
        dataset.of_split("train")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("[1]", "should be an object"),
        ("{", "Invalid JSON"),
        ('{"objects": []}', "node: Field required"),
        ('{"node": "n1", "objects": [{"name": "x", "area": 1.5}]}', r"objects.0.area"),
        ('{"node": "n1", "objects": [{"name": "x", "area": NaN}]}', r"objects.0.area"),
        ('{"node": "n1", "image": "../../../etc/passwd"}', "outside the folder"),
        ('{"node": "n1", "image": "/etc/passwd"}', "outside the folder"),
        ('{"node": "n1"}\n{"node": "n1"}', "line 2: the node 'n1' is there twice"),
    ],
)
def test_truth_that_is_none_is_refused_with_its_line(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "truth.jsonl").write_text(line)
    with pytest.raises(InputError, match=message) as caught:
        read_truth(tmp_path / "truth.jsonl", tmp_path)
    assert "truth.jsonl: line" in caught.value.where


def test_truth_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "truth.jsonl").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="cannot be read"):
        read_truth(tmp_path / "truth.jsonl", tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        read_truth(tmp_path / "nowhere", tmp_path)


def test_a_world_as_the_simulator_writes_it(tmp_path: Path) -> None:
    """Truth in a folder of its own, with shares, looks and signs; an image and object nodes from the observations."""
    folder = tmp_path / "worlds" / "park"
    rows = [
        {"id": "park-a-0", "pose": {"x": 0, "y": 0}, "image": "images/0.jpg"},
        {"id": "park-a-1", "pose": {"x": 1, "y": 0}},
        {"id": "bench-1@a", "kind": "object", "pose": {"x": 1, "y": 1}, "name": "bench"},
    ]
    lines(folder / "observations.jsonl", rows)
    lines(tmp_path / ".work" / "town" / "observations.jsonl", rows)
    (folder / "meta.json").write_text(META)
    (folder / "images").mkdir()
    (folder / "images" / "0.jpg").write_bytes(b"\xff\xd8\xff")
    seen = {"name": "bench", "share": 0.02, "colour": "brown", "shape": "metal", "text": "In memory", "side": "left"}
    small = {"name": "tree", "share": 0.002}
    view = {"node": "park-a-0", "split": "train", "place": "park", "season": "spring", "objects": [seen, small]}
    lines(tmp_path / "truth" / "park.jsonl", [view | {"caption": "A bench."}, {"node": "park-a-1", "objects": []}])
    lines(tmp_path / "queries.jsonl", [QUERIES[0] | {"environment": "park", "relevant": ["park-a-0"]}])
    (environment,) = load_dataset("simulated", tmp_path).environments
    assert (environment.name, environment.split, len(environment.questions)) == ("park", "train", 1)
    truth = environment.truths.of("park-a-0")
    assert truth.objects == (SeenObject("bench", 0.02, "brown metal", "In memory"), SeenObject("tree", 0.002))
    assert truth.texts == ("A bench.", 'park, brown metal bench reading "In memory", spring.')
    assert truth.image == folder / "images" / "0.jpg"
    assert environment.truths.of("park-a-1").image is None
    assert environment.truths.of("bench-1@a").objects == (SeenObject("bench"),)


def test_a_world_has_one_split(world: Path) -> None:
    lines(world / "truth.jsonl", [{"node": "a", "split": "train"}, {"node": "b", "split": "test"}])
    with pytest.raises(InputError, match=r"line 2: the splits \['test', 'train'\]"):
        read_truth(world / "truth.jsonl", world)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"id": "q", "query": "x", "relevant": "n1"}, "relevant is 'n1'"),
        ({"id": "q", "query": "x", "relevant": [True]}, "relevant is"),
        ({"id": "q", "query": "x", "targets": [["a"]]}, "targets is"),
        ({"id": "q", "query": "x", "golden_answer": " "}, "golden_answer is"),
    ],
)
def test_labels_of_another_type_are_refused(tmp_path: Path, row: dict, message: str) -> None:
    lines(tmp_path / "q.jsonl", [row])
    with pytest.raises(InputError, match=message):
        questions(tmp_path / "q.jsonl")


def test_a_question_that_is_no_object_is_refused(tmp_path: Path) -> None:
    (tmp_path / "q.jsonl").write_text("3\n")
    with pytest.raises(InputError, match="line 1: not a JSON object"):
        questions(tmp_path / "q.jsonl")


def test_numbers_as_ids_are_texts(tmp_path: Path) -> None:
    lines(tmp_path / "q.jsonl", [{"id": 7, "query": "x", "relevant": [1, "2"]}])
    (question,) = questions(tmp_path / "q.jsonl")
    assert (question.id, question.relevant) == ("7", frozenset({"1", "2"}))


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"no data set 'mars'.*allowed: building99, cmu_500, coex_1f, sample, simulated"
    ):
        load_dataset("mars")
    with pytest.raises(ConfigError, match="needs its folder"):
        load_dataset("cmu_500")
    with pytest.raises(InputError, match="no questions of its own"):
        load_dataset("cmu_500", tmp_path)
    with pytest.raises(InputError, match=r"there is no topological_map\.gml"):
        load_dataset("cmu_500", tmp_path, tmp_path / "q.jsonl")
    with pytest.raises(InputError, match="no folder in it has"):
        load_dataset("simulated", tmp_path)


def test_a_data_set_has_environments_with_names_of_their_own() -> None:
    one = Environment("a", Path("a"), ())
    with pytest.raises(InputError, match="'a' is there twice"):
        Dataset("d", (one, one))
    with pytest.raises(InputError, match="no environment"):
        Dataset("d", ())


def test_one_module_makes_a_data_set(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A module in the package's folder is found; one without a name, such as the catalogue, is not a data set."""
    source = '"""Mars."""\nfrom pathlib import Path\nfrom erag.evaluate.dataset import Dataset, Environment\n'
    source += 'NAME = "mars"\ndef load(root, queries):\n    return Dataset(NAME, (Environment("crater", root, ()),))\n'
    (tmp_path / "mars.py").write_text(source)
    package = types.SimpleNamespace(
        __name__=catalogue.package.__name__, __path__=[*catalogue.package.__path__, str(tmp_path)]
    )
    monkeypatch.setattr(catalogue, "package", package)
    monkeypatch.setattr("erag.evaluate.datasets.__path__", package.__path__)
    assert list(loaders()) == ["building99", "cmu_500", "coex_1f", "mars", "sample", "simulated"]
    assert load_dataset("mars", tmp_path).environments[0].name == "crater"


@pytest.mark.shared
@pytest.mark.parametrize(("name", "nodes", "asked"), [("cmu_500", 3313, 44), ("building99", 257, 14)])
def test_the_outside_data(shared: Path, name: str, nodes: int, asked: int) -> None:
    dataset = load_dataset(name, shared / "data" / name, shared / "queries" / "dev.jsonl")
    (environment,) = dataset.environments
    assert (len(environment.truths.by_node), len(environment.questions)) == (nodes, asked)
    assert not environment.truths.independent
    ids = {o.id for o in read(environment.source).observations}
    assert all(q.relevant is None or (q.relevant and q.relevant <= ids) for q in environment.questions)
