"""What every backend must do, whatever its models are."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.core.errors import BadModelOutput, ConfigError, RoleMissing
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_backend
from erag.lm.fake import Fake, FakeConfig
from erag.lm.journal import Journal
from erag.lm.roles import ROLES, Group, LMBackend, Prompt, Roles, SelectTask
from erag.lm.weights import default_store
from erag.memory.database import Database
from erag.memory.file import MemoryFile

TEXTS = ["a bench under a tree", "a bus stop", "a bench under a tree", "x", "Ein Café am Fluß 🚲"]


@pytest.fixture(params=["fake", "journal", pytest.param("sentence", marks=pytest.mark.weights)])
def backend(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[LMBackend]:
    if request.param == "sentence":
        yield build_backend(BackendConfig(), request.getfixturevalue("weights"))
        return
    fake = compose({"fake": Fake()}, Roles(dict.fromkeys(ROLES, "fake")))
    if request.param == "fake":
        yield fake
        return
    Database.create(tmp_path / "m.erag")
    memory = MemoryFile(tmp_path / "m.erag", "write")
    yield Journal(fake, memory.calls)
    memory.close()


def test_embed_gives_a_unit_row_a_text_in_order(backend: LMBackend) -> None:
    vectors = backend.embed(TEXTS, "document")
    assert vectors.dtype == np.float32
    assert len(vectors) == len(TEXTS)
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-3)
    assert np.array_equal(vectors[0], vectors[2])
    assert vectors[0] @ vectors[1] < 0.9


def test_embed_does_not_depend_on_the_order_of_the_texts(backend: LMBackend) -> None:
    forward = backend.embed(TEXTS, "document")
    backward = backend.embed(TEXTS[::-1], "document")[::-1]
    assert np.abs(forward - backward).max() < 1e-2


def test_similar_texts_are_nearer_than_others(backend: LMBackend) -> None:
    bench, seat, bus = backend.embed(
        ["a wooden bench to sit on", "a wooden bench to rest on", "bus timetable"], "query"
    )
    assert bench @ seat > bench @ bus


def test_embed_of_nothing_is_nothing(backend: LMBackend) -> None:
    assert len(backend.embed([], "query")) == 0


def test_identity_and_fingerprint_are_stable(backend: LMBackend) -> None:
    assert backend.identity("embed") == backend.identity("embed")
    assert backend.fingerprint("embed") == backend.fingerprint("embed")
    assert backend.batch_size("embed") >= 1


def has(backend: LMBackend, role: str) -> bool:
    try:
        backend.identity(role)  # type: ignore[arg-type]
    except RoleMissing:
        return False
    return True


def test_every_text_role_answers_each_input_in_order(backend: LMBackend, tmp_path: Path) -> None:
    if not has(backend, "select"):
        with pytest.raises(RoleMissing, match="select"):
            backend.select([SelectTask("q", ("a",))], 1)
        return
    image = tmp_path / "a.jpg"
    Image.new("RGB", (4, 4), (9, 9, 9)).save(image)
    assert backend.caption([image, image])[0] == backend.caption([image])[0]
    groups = [Group(("a red bench", "a red bin")), Group(("a pond",))]
    assert [s.text for s in backend.summarise(groups)] == ["a red bench", "a pond"]
    tasks = [SelectTask("red bench", ("blue pond", "red bench", "red bin")), SelectTask("pond", ("a pond",))]
    assert backend.select(tasks, 2) == [[1, 2], [0]]
    assert backend.score([("red bench", "a red bench"), ("red bench", "pond")]).tolist() == [1.0, 0.0]
    said = backend.generate([Prompt((("user", "one two three"),), max_tokens=2)])[0]
    assert (said.text, said.truncated) == ("one two", True)


def test_selection_does_not_depend_on_the_order_of_cards() -> None:
    cards = ("a red bench", "a blue bench", "a pond", "red")
    picked = Fake().select([SelectTask("red bench", cards), SelectTask("red bench", cards[::-1])], 3)
    assert [cards[i] for i in picked[0]] == [cards[::-1][i] for i in picked[1]]


def test_generation_under_a_schema_is_json_of_that_schema() -> None:
    schema = {"type": "object", "properties": {"n": {"type": "integer", "minimum": 3}}, "required": ["n"]}
    assert Fake().generate([Prompt((("user", "x"),), schema)])[0].text == '{"n": 3}'


class Broken(Fake):
    """A model that answers badly in every role."""

    def embed(self, texts, kind):  # type: ignore[no-untyped-def]
        return np.full((len(texts), 4), np.nan, np.float32)

    def summarise(self, groups):  # type: ignore[no-untyped-def]
        return []

    def select(self, tasks, k):  # type: ignore[no-untyped-def]
        return [[0, 0] for _ in tasks]

    def score(self, pairs):  # type: ignore[no-untyped-def]
        return np.full(len(pairs), 1.5, np.float32)


def test_bad_output_is_an_error_and_never_padded() -> None:
    broken = compose({"b": Broken()}, Roles(dict.fromkeys(ROLES, "b")))
    with pytest.raises(BadModelOutput, match="a bench"):
        broken.embed(["a bench"], "query")
    with pytest.raises(BadModelOutput, match="0 results for 1"):
        broken.summarise([Group(("a",))])
    with pytest.raises(BadModelOutput, match=r"selected \[0, 0\]"):
        broken.select([SelectTask("q", ("a", "b"))], 2)
    with pytest.raises(BadModelOutput):
        broken.score([("q", "a")])


def test_roles_must_fit_their_models() -> None:
    with pytest.raises(ConfigError, match="no model 'absent'"):
        compose({"fake": Fake()}, Roles({"embed": "absent"}))
    with pytest.raises(ConfigError, match="cannot play"):
        build_backend(BackendConfig(roles={"score": "minilm"}), default_store())


def test_config_refuses_what_it_does_not_know() -> None:
    with pytest.raises(ValueError, match="kind"):
        BackendConfig.model_validate({"models": {"m": {"kind": "os.system"}}})
    with pytest.raises(ValueError, match="surprise"):
        BackendConfig.model_validate({"models": {"m": {"kind": "fake", "surprise": 1}}})
    assert FakeConfig(dim=8).dim == 8
