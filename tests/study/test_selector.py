"""An adapter taught by made-up decisions over word-count vectors: it learns, resumes, and plays its roles."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from chats import chat, told

pytest.importorskip("lightning", reason="needs erag[train]")

from erag.core.errors import InputError, ModelError
from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.config import BackendConfig, build_backend
from erag.lm.fake import FakeConfig
from erag.lm.roles import SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import area, platt
from erag.study.ceiling import lots
from erag.study.decisions import ChatDecisions, Part, RecordedDecisions, read_decisions
from erag.study.pairs import folds
from erag.study.selector import STUDENT, distil
from erag.study.standing import QUESTIONS, SETS, STRICT, Report
from erag.study.textconfig import AdapterDistil, TextTraining

# What nobody can know without having been taught: a need is met by a thing that shares no word with it.
MET = {
    "thirsty": "fountain", "tired": "sofa", "hungry": "cafeteria", "lost": "signpost", "cold": "radiator",
    "dirty": "washbasin", "late": "clock", "bored": "television",
}  # fmt: skip
SETS_OF = [tuple(np.random.default_rng(i).permutation(list(MET.values()))[:4]) for i in range(12)]
SAYING = ("I am {}.", "My friend is {} now.", "We are so {} today!", "They must be {}, help!", "Somebody looks {}.")


@pytest.fixture(scope="module")
def chats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("chats") / "decisions.jsonl"
    lines = list(told(MET, SETS_OF, SAYING, "A room with a {} in it."))
    path.write_text("\n".join([*lines, lines[0], chat("Where?", ("sofa",), "sofa_1")]))
    return path


def _config(chats: Path, out: Path) -> AdapterDistil:
    return AdapterDistil(
        kind="selector", decisions=(ChatDecisions(kind="chats", paths=(chats,)),), taught_by="Taught by a rule.",
        embedder=FakeConfig(dim=96), rank=16, members=2, folds=3, work=out / "work", out=out / "selector.safetensors",
        training=TextTraining(epochs=12, batch_size=16, rate=1e-2, dropout=0.1, wandb=False), resamples=50,
        curve=(4, 16),
    )  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    root = tmp_path_factory.mktemp("store")
    return ModelStore(root / "manifests", root / "files")


@pytest.fixture(scope="module")
def taught(chats: Path, store: ModelStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[AdapterDistil, Report]:
    config = _config(chats, tmp_path_factory.mktemp("taught"))
    return config, distil(config, store)


def test_it_learns_what_no_word_gives_away(taught: tuple[AdapterDistil, Report]) -> None:
    _, report = taught
    for split in (QUESTIONS, SETS):
        assert report.agreement[split][STUDENT].mean > 0.9
        assert report.agreement[split]["cosine"].mean < 0.6
        assert report.area[split][STUDENT].mean > 0.9 > report.area[split]["cosine"].mean
    assert report.chance == 0.25
    assert report.agreement[SETS][STRICT].mean <= report.agreement[SETS][STUDENT].mean


def test_the_card_says_what_was_measured_and_whose_choices_it_learnt(taught: tuple[AdapterDistil, Report]) -> None:
    config, report = taught
    card = config.out.with_suffix(".md").read_text()
    assert "Taught by a rule." in card
    assert f"{report.agreement[SETS][STUDENT].mean:.3f} [" in card
    assert f"{report.sets} sets of one" in card
    figures = json.loads((config.work / "figures.json").read_text())
    assert figures["agreement"][QUESTIONS][STUDENT]["mean"] == report.agreement[QUESTIONS][STUDENT].mean


def test_the_card_says_how_steady_the_teacher_is_and_what_more_questions_bring(
    taught: tuple[AdapterDistil, Report],
) -> None:
    config, report = taught
    assert [one.questions for one in report.curve] == [4, 16]
    few, many = (one.agreement.mean for one in report.curve)
    assert few < many <= report.agreement[QUESTIONS][STUDENT].mean + 0.05
    card = config.out.with_suffix(".md").read_text()
    assert f"| 4 | {few:.3f} [" in card
    assert "## How steady the teacher is" in card
    (kind,) = report.kinds  # "I am tired." asks for no place
    assert (kind.name, kind.decisions) == ("ask something else", report.decisions)
    assert kind.agreement[STUDENT] == report.agreement[QUESTIONS][STUDENT]
    assert f"| ask something else | {report.decisions} |" in card


def test_a_curve_that_cannot_be_drawn_is_refused_before_anything_is_taught(
    chats: Path, store: ModelStore, tmp_path: Path
) -> None:
    config = _config(chats, tmp_path)
    for count, said in ((1, "with 1 questions"), (1000, "with 1000 questions, of which")):
        with pytest.raises(InputError, match=said):
            distil(config.model_copy(update={"curve": (count,)}), store)
    assert not list(config.work.glob("run-*"))
    assert not config.out.exists()


def test_fewer_questions_are_taught_in_as_many_steps(chats: Path) -> None:
    decisions = read_decisions((ChatDecisions(kind="chats", paths=(chats,)),))
    fold = folds([d.query for d in decisions], 3, 0)
    some = lots((4, 20), decisions, fold, 16, 0)
    assert [lot.questions for lot in some] == [4] * 3 + [20] * 3
    for few, many in zip(some[:3], some[3:], strict=True):
        assert set(few.taught) < set(many.taught)
        asked = {decisions[row].query for row in few.asked}
        assert len({decisions[row].query for row in few.taught}) == 4
        assert not asked & {decisions[row].query for row in many.taught}
        assert few.repeats * len(few.taught) == pytest.approx(many.repeats * len(many.taught))
        assert few.repeats * len(few.taught) == pytest.approx(len(decisions) - len(few.asked))


def test_a_steady_teacher_chooses_the_same_for_questions_that_say_the_same() -> None:
    from erag.lm.adapter import embedder_of
    from erag.study.ceiling import pairs_among, steadiness
    from erag.study.decisions import Decision
    from erag.study.pairs import table

    cards = ("a sofa", "a clock")
    asked = ("where is one to sit down now", "where is one to sit down now please", "when does the train leave today")
    steady = [Decision(query, cards, chosen) for query, chosen in zip(asked, (0, 0, 1), strict=True)]
    torn = [*steady[:1], Decision(asked[1], cards, 1), steady[2]]
    other = [*steady[:1], Decision(asked[1], cards[::-1], 0)]  # of other cards, as far as anybody knows
    embed = lambda texts: embedder_of(FakeConfig(dim=96), None).embed(texts, "document")  # type: ignore[arg-type] # noqa: E731
    found, broken, none = (steadiness(pairs_among(some, table(some, embed)), 50) for some in (steady, torn, other))
    assert [(one.pairs, one.same.mean) for one in found if one.least >= 0.9] == [(1, 1.0)]
    assert [(one.pairs, one.same.mean) for one in broken if one.least >= 0.9] == [(1, 0.0)]
    assert none == []


def _adapter(config: AdapterDistil, store: ModelStore, **more: object) -> Adapter:
    return Adapter(AdapterConfig(checkpoint=config.out, embedder=config.embedder, **more), store)  # type: ignore[arg-type]


def test_it_selects_whatever_the_order_of_the_cards(taught: tuple[AdapterDistil, Report], store: ModelStore) -> None:
    adapter = _adapter(taught[0], store)
    cards = tuple(f"{thing} zone. A room with a {thing} in it." for thing in MET.values())
    tasks = [SelectTask(f"I am {need}.", cards) for need in MET]
    assert [picks[0] for picks in adapter.select(tasks, 3)] == list(range(len(MET)))
    turned = adapter.select([SelectTask(task.query, task.cards[::-1]) for task in tasks], 3)
    assert [[len(MET) - 1 - i for i in picks] for picks in turned] == adapter.select(tasks, 3)
    assert adapter.select([SelectTask("I am tired.", ("one",))], 3) == [[0]]
    assert adapter.select([], 3) == []


def test_scores_are_chances_of_single_pairs(taught: tuple[AdapterDistil, Report], store: ModelStore) -> None:
    adapter = _adapter(taught[0], store)
    pairs = [(f"I am {need}.", f"{t} zone. A room with a {t} in it.") for need in MET for t in MET.values()]
    scores = adapter.score(pairs)
    right = np.array([MET[q.removeprefix("I am ").strip(".")] == c.split()[0] for q, c in pairs], float)
    assert area(scores.astype(float), right) > 0.9
    assert scores.dtype == np.float32
    assert ((scores >= 0) & (scores <= 1)).all()
    assert adapter.score([pairs[5]])[0] == pytest.approx(scores[5], abs=1e-6)
    assert adapter.score([]).shape == (0,)


def test_it_is_a_backend_and_forgets_what_it_may(taught: tuple[AdapterDistil, Report], store: ModelStore) -> None:
    config, _ = taught
    model = {"kind": "adapter", "checkpoint": config.out, "embedder": {"kind": "fake", "dim": 96}, "kept": 2}
    backend = build_backend(
        BackendConfig.model_validate({"models": {"a": model}, "roles": {"select": "a", "score": "a"}}), store
    )
    tasks = [SelectTask("I am cold.", ("sofa", "radiator", "clock")), SelectTask("I am late.", ("clock", "fountain"))]
    assert backend.select(tasks, 1) == _adapter(config, store).select(tasks, 1)
    assert backend.select(tasks, 1) == backend.select(tasks, 1)
    assert json.loads(backend.identity("select"))["kind"] == "adapter"


def test_another_embedder_and_what_is_no_checkpoint_are_refused(
    taught: tuple[AdapterDistil, Report], store: ModelStore, tmp_path: Path
) -> None:
    other = Adapter(AdapterConfig(checkpoint=taught[0].out, embedder=FakeConfig(dim=96, seed=1)), store)
    with pytest.raises(ModelError, match="was trained on vectors"):
        other.select([SelectTask("I am cold.", ("sofa", "clock"))], 1)
    (tmp_path / "text").write_text("not a checkpoint")
    for path, said in ((tmp_path / "none", "no such checkpoint"), (tmp_path / "text", "no checkpoint of kind adapter")):
        with pytest.raises(ModelError, match=said):
            Adapter(AdapterConfig(checkpoint=path), store).identity("select")


def test_the_same_bytes_after_kill_9(taught: tuple[AdapterDistil, Report], chats: Path, tmp_path: Path) -> None:
    """A process of its own is killed once a fold has been trained for some epochs, and started again."""
    config = _config(chats, tmp_path)
    written = tmp_path / "config.json"
    written.write_text(config.model_dump_json())
    code = (
        "import sys\nfrom pathlib import Path\nfrom erag.lm.weights import ModelStore\n"
        "from erag.study.selector import distil\nfrom erag.study.textconfig import AdapterDistil\n"
        "config = AdapterDistil.model_validate_json(Path(sys.argv[1]).read_text())\n"
        "distil(config, ModelStore(config.work / 'm', config.work / 'f'))\n"
    )
    command = [sys.executable, "-c", code, str(written)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not list(config.work.glob("run-*/*1/last.ckpt")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not config.out.exists()
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
    assert config.out.read_bytes() == taught[0].out.read_bytes()
    figures = [json.loads((work / "figures.json").read_text())["agreement"] for work in (config.work, taught[0].work)]
    assert figures[0] == figures[1]


def test_what_is_left_for_the_comparison_is_not_seen(chats: Path, store: ModelStore, tmp_path: Path) -> None:
    part, short = Part(number=1, folds=3), TextTraining(epochs=1, batch_size=16, wandb=False)
    config = _config(chats, tmp_path).model_copy(update={"without": part, "training": short, "folds": 2, "curve": ()})
    found = read_decisions(config.decisions)
    held = [decision for decision in found if part.holds(decision)]
    assert 0 < len(held) < len(found)
    assert distil(config, store).decisions == len(found) - len(held)
    assert "Part 1 of 3 by question was never seen" in config.out.with_suffix(".md").read_text()


def test_recorded_decisions_are_read_from_a_memory(tmp_path: Path) -> None:
    from erag.lm.fake import Fake
    from erag.lm.journal import Journal
    from erag.memory.file import MemoryFile

    tasks = [SelectTask("a red door", ("blue door", "red door", "wall")), SelectTask("one", ("only",))]
    with MemoryFile.writing(tmp_path / "m.erag", "test", create=True) as memory:
        Journal(Fake(), memory.calls).select(tasks, 2)
    found = read_decisions([RecordedDecisions(kind="records", paths=(tmp_path / "m.erag",))])
    assert [(d.query, d.cards, d.chosen) for d in found] == [("a red door", ("blue door", "red door", "wall"), 1)]


def test_decisions_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    path = tmp_path / "d.jsonl"
    for text, said in (("{}", "no chat"), (chat("?", (), "x"), "no location"), ('{"messages": 1}', "no chat")):
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_decisions([ChatDecisions(kind="chats", paths=(path,))])
    path.write_text(chat("Where?", ("sofa", "clock"), "none_of_them"))
    with pytest.raises(InputError, match="no decision"):
        read_decisions([ChatDecisions(kind="chats", paths=(path,))])


def test_groups_stay_together_and_folds_are_even() -> None:
    groups = [f"g{i % 23}" for i in range(400)] + ["large"] * 60
    fold = folds(groups, 5, seed=3)
    assert all(len(set(fold[np.array(groups) == g])) == 1 for g in set(groups))
    assert np.bincount(fold, minlength=5).max() - np.bincount(fold, minlength=5).min() <= 60
    assert (fold == folds(groups, 5, seed=3)).all()
    assert (fold != folds(groups, 5, seed=4)).any()


def test_calibration_and_area() -> None:
    rng = np.random.default_rng(0)
    logits = rng.normal(size=4000)
    right = (rng.random(4000) < 1 / (1 + np.exp(-(2 * logits - 1)))).astype(float)
    slope, offset = platt(logits, right)
    assert slope == pytest.approx(2, abs=0.25)
    assert offset == pytest.approx(-1, abs=0.15)
    assert area(np.array([1.0, 2, 2, 3]), np.array([0.0, 0, 1, 1])) == pytest.approx(0.875)
    assert np.isnan(area(np.ones(3), np.ones(3)))


@pytest.mark.shared
def test_the_published_decisions_are_what_is_known_of_them(shared: Path) -> None:
    folder = shared / "data" / "retrieval_qa"
    found = read_decisions([ChatDecisions(kind="chats", paths=(folder / "train.jsonl", folder / "test.jsonl"))])
    assert (len(found), len({d.query for d in found}), len({d.group for d in found})) == (1860, 467, 26)
    assert np.mean([d.chosen == 0 for d in found]) == pytest.approx(0.384, abs=1e-3)
