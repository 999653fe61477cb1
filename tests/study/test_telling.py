"""Summaries as a task: worlds that a teacher has summarised, what is taught of them, and how answers are judged."""

from dataclasses import replace
from shutil import copytree

import pytest

from erag.data.registry import read
from erag.data.sample import sample_dir
from erag.data.writer import write_folder
from erag.lm import prompts
from erag.lm.fake import Fake, FakeConfig
from erag.lm.weights import ModelStore, default_store
from erag.pipeline.config import validate
from erag.study import places as module
from erag.study.loraconfig import Places, TellingTask
from erag.study.places import summarised
from erag.study.telling import NEAR, STRANGE, TOLD, Telling

WORLDS = ("east", "west")


@pytest.fixture(scope="module")
def store() -> ModelStore:
    found = default_store()
    if found.state("minilm-l6") == "missing":
        pytest.skip("minilm-l6 is not here: erag models pull minilm-l6")
    return found


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> TellingTask:
    """Two halves of the sample as worlds that were rendered before."""
    folder = tmp_path_factory.mktemp("places")
    reading = read(sample_dir())
    kept = [o for o in reading.observations if o.caption]
    for name, part in zip(WORLDS, (kept[:20], kept[20:40]), strict=True):
        ids = {o.id for o in part}
        edges = tuple(e for e in reading.edges if {e.a, e.b} <= ids)
        small = replace(reading, observations=tuple(part), edges=edges, clusters=(), issues=())
        write_folder(folder / "worlds-0" / "worlds" / name, small)
        (folder / "worlds-0" / "truth").mkdir(exist_ok=True)
        (folder / "worlds-0" / "truth" / f"{name}.jsonl").touch()
    where = Places(teacher=FakeConfig(), worlds=WORLDS, folder=folder)
    return TellingTask(kind="summarise", places=where, embedder=FakeConfig(), vectors=folder / "vectors")


@pytest.fixture(scope="module")
def task(config: TellingTask, store: ModelStore) -> Telling:
    return Telling(config, store)


def test_each_world_is_a_group_of_its_clusters(task: Telling) -> None:
    assert set(task.groups) == set(WORLDS)
    assert len(task.groups) == len(task.asked) == len(task.taught) > 2


def test_a_teacher_is_not_asked_again(config: TellingTask, store: ModelStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Fake, "summarise")
    assert config.places
    assert len(summarised(config.places, store)) == len(WORLDS)
    with pytest.raises(AttributeError, match="summarise"):
        summarised(config.places.model_copy(update={"teacher": FakeConfig(seed=2)}), store)


def test_a_world_furnished_anew_is_the_same_place(config: TellingTask, task: Telling, store: ModelStore) -> None:
    assert config.places
    copytree(config.places.folder / "worlds-0", config.places.folder / "worlds-1")
    places = config.places.model_copy(update={"seeds": (0, 1)})
    assert len(summarised(places, store)) == 4
    both = Telling(config.model_copy(update={"places": places}), store)
    assert set(both.groups) == set(WORLDS)
    assert len(both.groups) == 2 * len(task.groups)


def test_another_teacher_has_memories_of_its_own(config: TellingTask, store: ModelStore) -> None:
    assert config.places
    other = config.places.model_copy(update={"teacher": FakeConfig(seed=1)})
    assert not set(summarised(other, store)) & set(summarised(config.places, store))


def test_worlds_that_are_missing_are_rendered(
    config: TellingTask, store: ModelStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(module, "render", lambda *given, **named: asked.append((given, named)))
    assert config.places
    summarised(config.places, store)
    assert not asked
    with pytest.raises(Exception, match="moon"):
        summarised(config.places.model_copy(update={"worlds": ("east", "moon")}), store)
    ((_, names, seed, _), named), *_ = asked
    assert (names, seed) == (("east", "moon"), 0)
    assert named == {"objects": False, "captions": "truth", "size": (160, 120)}


def test_a_lesson_is_the_prompt_of_the_summariser_and_what_the_teacher_said(task: Telling) -> None:
    (lesson,) = task.lessons(0)
    name, text, *_ = task.taught[0]
    assert name in lesson.answer
    assert text in lesson.answer
    group = task._groups[0]
    assert lesson.messages == prompts.summarise(group)
    assert group.facts


def test_figures_tell_a_full_answer_from_an_empty_and_from_an_invented_one(task: Telling) -> None:
    rows = list(range(len(task.groups)))
    full = [(" ".join(task._groups[row].facts),) for row in rows]
    empty = [("",) for _ in rows]
    strange = [("unicorns above a volcano",) for _ in rows]
    told, none, odd = (task.figures(rows, answers, 20) for answers in (full, empty, strange))
    assert told[TOLD].mean > 0.95 > 0.05 > none[TOLD].mean
    assert odd[STRANGE].mean > 0.9 > 0.1 > told[STRANGE].mean
    assert task.figures(rows, task.taught, 20)[NEAR].mean == pytest.approx(1, abs=1e-6)
    assert task.answers(Fake(), rows[:2]) == task.taught[:2]  # type: ignore[arg-type]


def test_one_place_cannot_be_left_out() -> None:
    with pytest.raises(Exception, match="fewer than two places"):
        validate(TellingTask, {"kind": "summarise", "memories": ["a.erag"]}, "here")
    assert validate(TellingTask, {"kind": "summarise", "memories": ["a.erag", "b.erag"]}, "here").places is None
