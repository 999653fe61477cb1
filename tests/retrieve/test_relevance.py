"""The relevance model: evidence by columns, uses of things, probabilities, and a lexicon that is what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from retrieve_worlds import corpus_of, embed, random_forest, random_nodes
from test_retrieve_models import Model, backend

from erag.core.errors import ConfigError
from erag.core.types import Observation, Pose, Query
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_backend
from erag.lm.fake import Fake
from erag.lm.roles import LMBackend, Roles
from erag.lm.weights import ModelStore
from erag.retrieve.config import ExpandConfig, FusionConfig, RelevanceConfig, RetrieveConfig, TreeConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.engine import Retriever
from erag.retrieve.lexical import LexicalIndex, tokens
from erag.retrieve.relevance import NAMED, OWN, SERVES, EvidenceTable, RelevanceScorer, Weights, fitted
from erag.retrieve.scoring import Batch
from erag.retrieve.uses import BELOW, Lexicon, Use, Uses, lexicon_texts, read_uses, shipped_lexicon

RELEVANCE = RetrieveConfig(retriever=RelevanceConfig())


def places(*captions: str) -> list[Observation]:
    return [Observation(f"n{i}", "place", Pose(10.0 * i, 0), caption=text) for i, text in enumerate(captions)]


def lexicon(**uses: Use) -> Lexicon:
    fake = Fake()
    return Lexicon.of(uses, fake.embed(lexicon_texts(uses), "document"))


def use(*said: str, also: tuple[str, ...] = ()) -> Use:
    return Use.model_validate({"also": also, "said": said})


def fake_backend() -> LMBackend:
    return compose({"m": Fake()}, Roles(dict.fromkeys(("embed", "select", "score", "generate"), "m")))


def asked(corpus: Corpus, config: RetrieveConfig, text: str, model: LMBackend) -> list[str]:
    found = Retriever(corpus, config, backend=model).retrieve([Query(text)], model.embed([text], "query"))[0]
    return [hit.node for hit in found.hits]


def fake_corpus(*captions: str) -> Corpus:
    """A corpus with the vectors of the fake embedder."""
    from dataclasses import replace

    corpus, fake = corpus_of(places(*captions)), Fake()
    vectors = fake.embed(list(captions), "document")
    return replace(corpus, node_vectors=vectors, sentence_vectors=vectors, sentence_rows=np.arange(len(captions)))


def test_the_shipped_model_knows_every_column() -> None:
    models = fitted()
    assert set(models.plain.weights) == {*OWN, *SERVES}
    assert set(models.named.weights) <= {*OWN, *SERVES, *NAMED}


def test_a_probability_by_hand() -> None:
    model = Weights(bias=-1, weights={"words": 2.0})
    found = model.probability(np.array([[5.0, 0.5], [5.0, 1.0]]), ("caption", "words"))
    assert found == pytest.approx([0.5, 1 / (1 + np.exp(-1))])


def test_named_things_win_over_their_colour_elsewhere() -> None:
    corpus = fake_corpus("A green tractor and a red barn.", "A red tractor.", "A red lorry and a bench.")
    assert asked(corpus, RELEVANCE, "Find a red tractor.", fake_backend())[0] == "n1"


def test_a_wish_finds_what_serves_it() -> None:
    uses = Uses(
        lexicon(bench=use("My feet hurt so much."), lamp=use("It is dark.")),
        LexicalIndex(("A tree.", "A lamp.", "Two benches.")),
    )
    (vector,) = Fake().embed(["My feet hurt so much."], "query")
    found = uses.scores(vector)
    assert found[0].tolist() == [BELOW, 0.0] * 3
    assert found[2, 0] > found[1, 0]
    assert (found[2, 1], found[1, 1]) == (1, 0.5)


def test_a_thing_goes_by_its_other_names() -> None:
    index = LexicalIndex(("A settee.", "A tree."))
    uses = Uses(lexicon(sofa=use("I want to lie down.", also=("couch", "settee"))), index)
    (vector,) = Fake().embed(["lie down"], "query")
    assert uses.scores(vector)[0, 1] == 1
    assert uses.scores(vector)[1, 1] == 0
    none = Uses(lexicon(lamp=use("It is dark.")), index)
    assert (none.scores(vector)[:, 1] == 0).all()


def test_the_shipped_lexicon_is_sound() -> None:
    uses = read_uses()
    assert len(uses) > 700
    for name, entry in uses.items():
        assert entry.texts, name
        head = tokens(name)[-1]
        assert not any(head in tokens(said) for said in entry.said), name


def test_shipped_vectors_are_those_of_the_shipped_texts(weights: ModelStore) -> None:
    model = build_backend(BackendConfig(), weights)
    found = shipped_lexicon(_Counting(model))
    sample = lexicon_texts(found.uses)[::997]
    exact = model.embed(sample, "document")
    stored = np.concatenate([found.vectors, found.names])[::997]
    assert (exact * stored).sum(1).min() > 0.999


class _Counting:
    """An embedder that must not be asked: the vectors are shipped."""

    def __init__(self, model: LMBackend) -> None:
        self._model = model

    def identity(self, role: str) -> str:
        return self._model.identity("embed")

    def embed(self, texts: object, kind: str) -> np.ndarray:
        raise AssertionError("the shipped vectors are stale: python scripts/embed_uses.py")


@pytest.mark.parametrize("text", ["[1, 2]", "bench: {said: 3}", "bench: {needs: [a]}", "bench: [", "\x00"])
def test_a_lexicon_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "uses.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"uses\.yaml"):
        read_uses(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_uses(tmp_path / "none.yaml")


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_scores_are_probabilities_whatever_the_company(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = random_nodes(rng, 9)
    corpus = corpus_of(nodes, random_forest(rng, nodes))
    table = EvidenceTable(corpus, None)
    texts = ("bench near the river", "café", "")
    batch = Batch(texts, embed(["bench river", "café", "door"]))
    together = [e.rows for e in table.of(batch)]
    for i, text in enumerate(texts):
        alone = table.of(Batch((text,), batch.vectors[i : i + 1]))[0].rows
        assert np.array_equal(alone, together[i])
        assert np.isfinite(alone).all()
        assert alone.shape == (9, len(OWN))


def test_what_a_model_names_joins_the_evidence() -> None:
    corpus = corpus_of(places("A fountain.", "A tree.", "A road."))
    config = RetrieveConfig(retriever=RelevanceConfig(uses=False), expand=ExpandConfig())
    model = Model(things=("fountain",))
    found = Retriever(corpus, config, backend=backend(model)).retrieve([Query("I am thirsty")], embed(["thirsty"]))[0]
    assert found.hits[0].node == "n0"
    assert found.probability == pytest.approx(found.hits[0].semantic)
    assert "also looked for: fountain" in found.notes


def test_only_probabilities_are_told_as_such() -> None:
    corpus = fake_corpus("A fountain.", "A tree.")
    for kind in (RelevanceConfig(), TreeConfig(scores=RelevanceConfig())):
        config = RetrieveConfig(retriever=kind)
        model = fake_backend()
        found = Retriever(corpus, config, backend=model).retrieve([Query("tree")], model.embed(["tree"], "query"))[0]
        assert found.probability is not None
        assert 0 < found.probability < 1
    fused = Retriever(corpus, RetrieveConfig(retriever=FusionConfig()))
    assert fused.retrieve([Query("tree")], fake_backend().embed(["tree"], "query"))[0].probability is None


def test_a_thing_asked_for_by_name_is_not_what_would_serve() -> None:
    """The lexicon says that a railway crossing closes a path; where barriers are on the map, barriers are meant."""
    corpus = fake_corpus("A railway crossing.", "Barriers beside a hedge.", "A hedge.")
    wish, known = "Find barriers closing a path", lexicon(railway_crossing=use("Find barriers closing a path"))
    known = Lexicon({"railway crossing": next(iter(known.uses.values()))}, known.vectors, known.owner, known.names)
    batch = Batch((wish,), Fake().embed([wish], "query"))
    table = EvidenceTable(corpus, known)
    (free,) = RelevanceScorer(table, fitted()).scores(batch)
    (literal,) = RelevanceScorer(table, fitted(), literal=True).scores(batch)
    assert (free.argmax(), literal.argmax()) == (0, 1)
    assert literal[1] == free[1]
    without = EvidenceTable(fake_corpus("A railway crossing.", "A fence beside a hedge.", "A hedge."), known)
    (unknown,) = RelevanceScorer(without, fitted(), literal=True).scores(batch)
    assert unknown.argmax() == 0  # nothing here has that name: what would serve is all there is
