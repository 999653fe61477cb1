"""A student of query understanding taught by a made-up teacher: it names, resumes, and leaves the rest to others."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("safetensors", reason="needs erag[sentence]")

from erag.core.errors import BadModelOutput, ConfigError, InputError, ModelError, RoleMissing
from erag.core.text import words
from erag.core.types import Query
from erag.data.sample import sample_dir
from erag.lm.config import BackendConfig, build_backend
from erag.lm.fake import Fake, FakeConfig
from erag.lm.roles import Generation, Prompt
from erag.lm.understanding import Understanding, UnderstandingConfig, distinct
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.pipeline.build import build
from erag.pipeline.config import PipelineConfig
from erag.pipeline.ingest import ingest
from erag.pipeline.query import Asker
from erag.retrieve.config import ExpandConfig
from erag.retrieve.expand import Expander, asking
from erag.study import understanding as study
from erag.study.teacher import taught
from erag.study.textconfig import UnderstandingDistil
from erag.study.understanding import FOUND, STUDENT, Report, distil
from erag.study.wishes import needs, wishes

RULE = {  # what a wish begins with decides: bags of words can be told apart by it
    "where": ("shop", "market"), "find": ("viewpoint", "window"), "take": ("bench", "sofa"), "need": ("lawn", "court"),
}  # fmt: skip


class Teacher(Fake):
    """Names what its rule says for the words of a wish; fails for wishes with `fail_on`; counts what it was asked."""

    def __init__(self, fail_on: str = "") -> None:
        super().__init__()
        self.asked: list[str] = []
        self.fail_on = fail_on

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        return [self._answer(prompt.messages[-1][1]) for prompt in prompts]

    def _answer(self, wish: str) -> Generation:
        self.asked.append(wish)
        if self.fail_on and self.fail_on in wish:
            raise BadModelOutput("said nothing")
        things = [t for word, named in RULE.items() if word in words(wish) for t in named] or ["somewhere else"]
        return Generation(json.dumps({"things": things}))


@pytest.fixture
def teacher(monkeypatch: pytest.MonkeyPatch) -> Teacher:
    one = Teacher()
    monkeypatch.setattr(study, "build_backend", lambda config, store: one)
    return one


def _config(out: Path) -> UnderstandingDistil:
    return UnderstandingDistil(
        kind="understanding", teacher=FakeConfig(), taught_by="Taught by a rule.", embedder=FakeConfig(dim=96), ways=1,
        limit=160, folds=3, ridge=1.0, blend=1.0, work=out / "work", out=out / "u.safetensors", resamples=50,
    )  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    root = tmp_path_factory.mktemp("store")
    return ModelStore(root / "manifests", root / "files")


@pytest.fixture(scope="module")
def done(store: ModelStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[UnderstandingDistil, Report]:
    config = _config(tmp_path_factory.mktemp("taught"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "build_backend", lambda config, store: Teacher())
        return config, distil(config, store)


def _student(config: UnderstandingDistil, store: ModelStore, **more: object) -> Understanding:
    return Understanding(UnderstandingConfig(checkpoint=config.out, embedder=config.embedder), store, **more)  # type: ignore[arg-type]


def test_it_names_what_its_teacher_would_for_needs_it_has_not_seen(
    done: tuple[UnderstandingDistil, Report], store: ModelStore
) -> None:
    config, report = done
    assert report.figures[STUDENT][FOUND].mean > 0.7
    assert report.figures[STUDENT][FOUND].mean > report.figures["nearest things"][FOUND].mean
    (named,) = Expander(_student(config, store), ExpandConfig(things=2)).things(["Where could I get a hat?"])  # type: ignore[arg-type]
    assert set(named) == {"shop", "market"}
    (named,) = Expander(_student(config, store), ExpandConfig(things=2)).things(["Find a window."])  # type: ignore[arg-type]
    assert "window" in named
    card = config.out.with_suffix(".md").read_text()
    assert "Taught by a rule." in card
    assert f"{report.figures[STUDENT][FOUND].mean:.3f} [" in card


def test_other_prompts_go_to_the_other_model(done: tuple[UnderstandingDistil, Report], store: ModelStore) -> None:
    config, _ = done
    model = {"kind": "understanding", "checkpoint": config.out, "embedder": {"kind": "fake", "dim": 96}}
    models = {"u": {**model, "otherwise": "f"}, "f": {"kind": "fake"}}
    backend = build_backend(BackendConfig.model_validate({"models": models, "roles": {"generate": "u"}}), store)
    asked = asking("Where can I get milk?", 5)
    other = Prompt((("user", "Write a poem."),))
    mixed = backend.generate([other, asked, other])
    assert mixed[0] == mixed[2] == Fake().generate([other])[0]
    assert "shop" in json.loads(mixed[1].text)["things"]
    assert backend.identity("generate") != _student(config, store).identity("generate")
    with pytest.raises(RoleMissing, match="otherwise"):
        _student(config, store).generate([other])
    models["u"]["otherwise"] = "nobody"
    with pytest.raises(ConfigError, match="no model 'nobody'"):
        build_backend(BackendConfig.model_validate({"models": models, "roles": {"generate": "u"}}), store)


def test_a_memory_is_asked_with_a_student_alone(
    done: tuple[UnderstandingDistil, Report], store: ModelStore, tmp_path: Path
) -> None:
    student = {"kind": "understanding", "checkpoint": done[0].out, "embedder": {"kind": "fake", "dim": 96}}
    raw = {
        "backend": {"models": {"f": {"kind": "fake"}, "u": student}, "roles": {"embed": "f", "generate": "u"}},
        "retrieve": {"retriever": {"kind": "node"}, "expand": {"things": 2}}, "answer": {"explain": "quotes"},
    }  # fmt: skip
    config, path = PipelineConfig.model_validate(raw), tmp_path / "m.erag"
    ingest(sample_dir(), path)
    with MemoryFile.writing(path, "test") as memory:
        build(memory, config, store)
    result = Asker(path, config, store).ask(Query("Where could I get a hat?"))
    assert "also looked for: shop, market" in result.notes or "also looked for: market, shop" in result.notes
    assert result.calls["generate"] == 1


def test_a_killed_study_asks_only_for_what_is_missing(
    done: tuple[UnderstandingDistil, Report], store: ModelStore, tmp_path: Path, teacher: Teacher
) -> None:
    class Killed(Exception):
        pass

    def kill(stage: str, done: int, total: int) -> None:
        if done >= 80:
            raise Killed

    config = _config(tmp_path)
    with pytest.raises(Killed):
        distil(config, store, kill)
    assert len(teacher.asked) == 80
    distil(config, store)
    assert len(teacher.asked) == 160
    assert config.out.read_bytes() == done[0].out.read_bytes()


def test_what_the_teacher_said_is_kept_and_its_failures_too(tmp_path: Path) -> None:
    path, asked = tmp_path / "teacher.jsonl", [(i, wish) for i, (_, wish) in enumerate(wishes(1, 0)[:20])]
    failing = asked[3][1]
    teacher = Teacher(fail_on=failing)
    rows = taught(teacher, asked, path, 6)
    assert [row.wish for row in rows if not row.things] == [failing]
    text = path.read_text()
    path.write_text(text[:-9])  # killed while it wrote
    teacher.asked.clear()
    assert taught(teacher, asked, path, 6) == rows
    assert len(teacher.asked) == 1
    with pytest.raises(InputError, match="another teacher"):
        taught(teacher, asked, path, 5)
    path.write_text(text + "{}\n")
    with pytest.raises(InputError, match=":22: no row"):
        taught(teacher, asked, path, 6)


def test_wishes_are_the_same_for_the_same_seed_and_say_every_need() -> None:
    assert wishes(2, 1) == wishes(2, 1) != wishes(2, 2)
    assert len({need for need, _ in wishes(1, 0)}) == len(needs().do) + len(needs().feel) == len(wishes(1, 0))
    assert len({wish for _, wish in wishes(3, 0)}) == len(wishes(3, 0))


def test_no_wish_stands_in_a_benchmark_or_in_the_simulator(request: pytest.FixtureRequest) -> None:
    from erag.data.sample import sample_queries
    from erag.sim.queries import wishes as simulated

    said = {" ".join(words(wish)) for _, wish in wishes(11, 0)}
    known = {" ".join(words(text)) for wish in simulated() for text in wish.say}
    known |= {" ".join(words(json.loads(line).get("query", ""))) for line in sample_queries().read_text().splitlines()}
    assert not said & known


@pytest.mark.shared
def test_no_wish_stands_among_the_development_queries(shared: Path) -> None:
    said = {" ".join(words(wish)) for _, wish in wishes(11, 0)}
    lines = (shared / "queries" / "dev.jsonl").read_text().splitlines()
    assert not said & {" ".join(words(json.loads(line).get("query", ""))) for line in lines}


@pytest.mark.shared
def test_wishes_resemble_those_they_are_measured_on_no_more_than_the_guide_says(
    shared: Path, weights: ModelStore
) -> None:
    """Cosines by MiniLM of each need's wish to the nearest query (docs/students.md#understanding-queries)."""
    from erag.lm.sentence import SentenceConfig, SentenceEmbedder
    from erag.sim.queries import wishes as simulated

    embedder = SentenceEmbedder(SentenceConfig(dtype="float32"), weights)
    own = wishes(2, 0)
    vectors = embedder.embed([wish for _, wish in own], "document")
    lines = (shared / "queries" / "dev.jsonl").read_text().splitlines()
    for texts, median, highest in (
        ([json.loads(line)["query"] for line in lines], 0.45, 0.88),
        ([text for wish in simulated() for text in wish.say], 0.51, 0.89),
    ):
        cosines = (vectors @ embedder.embed(texts, "document").T).max(axis=1)
        nearest: dict[int, float] = {}
        for (need, _), cosine in zip(own, cosines, strict=True):
            nearest[need] = max(nearest.get(need, -1.0), float(cosine))
        assert np.median(list(nearest.values())) < median
        assert max(nearest.values()) < highest


def test_things_alike_are_one_and_a_broken_header_is_refused(
    done: tuple[UnderstandingDistil, Report], store: ModelStore
) -> None:
    vectors = np.array([[1, 0], [0.99, 0.14], [0, 1]], np.float32)
    assert distinct(np.array([0.5, 0.4, 0.1], np.float32), vectors, 2).tolist() == [0, 2]
    other = Understanding(UnderstandingConfig(checkpoint=done[0].out, embedder=FakeConfig(seed=9)), store)
    with pytest.raises(ModelError, match="was trained on vectors"):
        other.things(["I want to buy a hat."], [1])
