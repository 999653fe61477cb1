"""Summaries as a task: worlds that a teacher has summarised, what is taught of them, and how answers are judged."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from shutil import copytree

import pytest

from erag.data.registry import read
from erag.data.sample import sample_dir
from erag.data.writer import write_folder
from erag.lm import prompts
from erag.lm.fake import Fake, FakeConfig
from erag.lm.roles import Group, Summary
from erag.lm.weights import ModelStore
from erag.memory.database import Database
from erag.pipeline.config import validate
from erag.study import places as module
from erag.study import worlds as rendering
from erag.study.loraconfig import Places, TellingTask
from erag.study.places import summarised
from erag.study.telling import LEFT, NEAR, STRANGE, TOLD, Telling

WORLDS = ("east", "west")


def _tells(self: Fake, groups: Sequence[Group]) -> list[Summary]:
    """The first thing of the lists, which stands beside the third one; and unicorns."""
    del self
    told = []
    for group in groups:
        things = [thing for fact in group.facts for thing in fact.partition(": ")[2].split(", ")]
        how = " beside ".join(things[:3:2])
        told.append(
            Summary(things[0], f"There is a {things[0]}. It also has unicorns.", (how, "unicorns above volcano"))
        )
    return told


@pytest.fixture(scope="module", autouse=True)
def _teacher() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Fake, "summarise", _tells)
        yield


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> TellingTask:
    """Two halves of the sample as worlds that were rendered before."""
    folder = tmp_path_factory.mktemp("places")
    reading = read(sample_dir())
    kept = [o for o in reading.observations if o.caption]
    for name, part in zip(WORLDS, (kept[::2], kept[1::2]), strict=True):
        ids = {o.id for o in part}
        edges = tuple(e for e in reading.edges if {e.a, e.b} <= ids)
        small = replace(reading, observations=tuple(part), edges=edges, clusters=(), issues=())
        write_folder(folder / "0-160-120" / "worlds" / name, small)
    where = Places(teacher=FakeConfig(), worlds=WORLDS, folder=folder)
    return TellingTask(kind="summarise", places=where, embedder=FakeConfig(), vectors=folder / "vectors")


@pytest.fixture(scope="module")
def task(config: TellingTask, weights: ModelStore) -> Telling:
    return Telling(config, weights)


def test_each_world_is_a_group_of_its_clusters(task: Telling) -> None:
    assert set(task.groups) == set(WORLDS)
    assert len(task.groups) == len(task.asked) == len(task.taught) > 2
    assert len(set(task.asked)) == len(task.asked)  # none stands there twice, though some were asked a second time


def test_a_teacher_is_not_asked_again(
    config: TellingTask, weights: ModelStore, task: Telling, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert task.groups
    monkeypatch.delattr(Fake, "summarise")
    assert config.places
    assert len(summarised(config.places, weights)) == len(WORLDS)
    with pytest.raises(AttributeError, match="summarise"):
        summarised(config.places.model_copy(update={"teacher": FakeConfig(seed=2)}), weights)


def test_a_world_furnished_anew_is_the_same_place(config: TellingTask, task: Telling, weights: ModelStore) -> None:
    assert config.places
    copytree(config.places.folder / "0-160-120", config.places.folder / "1-160-120")
    places = config.places.model_copy(update={"seeds": (0, 1)})
    assert len(summarised(places, weights)) == 4
    both = Telling(config.model_copy(update={"places": places}), weights)
    assert set(both.groups) == set(WORLDS)
    assert len(both.groups) == 2 * len(task.groups)


def test_another_teacher_has_memories_of_its_own(config: TellingTask, weights: ModelStore) -> None:
    assert config.places
    other = config.places.model_copy(update={"teacher": FakeConfig(seed=1)})
    assert not set(summarised(other, weights)) & set(summarised(config.places, weights))


def test_worlds_that_are_missing_are_rendered(
    config: TellingTask, weights: ModelStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(module, "render", lambda *given, **named: asked.append((given, named)))
    assert config.places
    with pytest.raises(Exception, match="moon"):
        summarised(config.places.model_copy(update={"worlds": ("east", "moon")}), weights)
    (((folder, names, seed, _), named),) = asked
    assert folder == config.places.folder / "0-160-120"
    assert (names, seed) == (("east", "moon"), 0)
    assert named == {"objects": False, "captions": "truth", "size": (160, 120)}


def test_worlds_that_are_all_there_need_no_simulator(config: TellingTask, monkeypatch: pytest.MonkeyPatch) -> None:
    assert config.places
    monkeypatch.setattr(rendering, "simulator", lambda name: pytest.fail(name))
    folder = config.places.folder / "0-160-120"
    rendering.render(folder, WORLDS, 0)
    (folder / ".work").mkdir()  # of a data set whose last steps were not reached
    with pytest.raises(pytest.fail.Exception, match="dataset"):
        rendering.render(folder, WORLDS, 0)
    (folder / ".work").rmdir()
    with pytest.raises(pytest.fail.Exception, match="dataset"):
        rendering.render(folder, (*WORLDS, "north"), 0)


def test_a_lesson_is_the_prompt_of_the_summariser_and_what_was_accepted_of_the_teacher(task: Telling) -> None:
    for row, (name, text, *how) in enumerate(task.taught):
        (lesson,) = task.lessons(row)
        assert json.loads(lesson.answer) == {"summary": text, "name": name, "relationships": how}
        group = task._items[row].group
        assert lesson.messages == prompts.summarise(group)
        assert group.facts
        assert task._items[row].left(Summary(name, text, tuple(how))) == Summary(name, text, tuple(how))


def test_what_no_member_bears_out_is_not_taught(config: TellingTask, weights: ModelStore, task: Telling) -> None:
    """Clusters of which nothing is left are left out, and so is what a second answer repeats."""
    assert config.places
    recorded = []
    for memory in summarised(config.places, weights):
        database = Database(memory, "read")
        recorded += database.rows("SELECT result FROM call_results WHERE role = 'summarise'")
        database.close()
    assert all("unicorns" in str(result) for (result,) in recorded)
    assert not any("unicorn" in part.lower() for answer in task.taught for part in answer)
    assert len(recorded) > len(task.groups)


def test_figures_tell_a_full_answer_from_an_empty_and_from_an_invented_one(task: Telling) -> None:
    rows = list(range(len(task.groups)))
    full = [("", " ".join(task._items[row].group.facts)) for row in rows]
    empty = [("", "") for _ in rows]
    strange = [("Unicorns", "Unicorns above a volcano.", "unicorn above volcano") for _ in rows]
    told, none, odd, own = (task.figures(rows, answers, 20) for answers in (full, empty, strange, task.taught))
    assert told[TOLD].mean > 0.95 > 0.05 > none[TOLD].mean
    assert odd[STRANGE].mean > 0.9 > 0.1 > told[STRANGE].mean
    assert own[NEAR].mean == pytest.approx(1, abs=1e-6)
    assert own[LEFT].mean == 1
    assert odd[LEFT].mean == none[LEFT].mean == 0


def test_one_place_cannot_be_left_out() -> None:
    with pytest.raises(Exception, match="fewer than two places"):
        validate(TellingTask, {"kind": "summarise", "memories": ["a.erag"]}, "here")
    with pytest.raises(Exception, match="fewer than two places"):
        validate(TellingTask, {"kind": "summarise", "memories": ["a.erag", "./a.erag"]}, "here")
    assert validate(TellingTask, {"kind": "summarise", "memories": ["a.erag", "b.erag"]}, "here").places is None
    for twice in ({"worlds": ["park", "park"]}, {"worlds": ["park", "farm"], "seeds": [1, 1]}):
        with pytest.raises(Exception, match="stands there twice"):
            validate(TellingTask, {"kind": "summarise", "places": {"teacher": {"kind": "fake"}, **twice}}, "here")


def test_a_card_quotes_no_memory_of_a_users_own(config: TellingTask, task: Telling, weights: ModelStore) -> None:
    assert config.places
    assert task.quotable
    memories = tuple(summarised(config.places, weights))
    own = Telling(config.model_copy(update={"places": None, "memories": memories}), weights)
    assert not own.quotable
    assert own.taught == task.taught
