"""Sentences that answer a question between them, and facts in its light."""

from pathlib import Path

import numpy as np
import pytest

from erag.generate.focus import Focus, counts
from erag.generate.views import Views
from erag.pipeline.session import Memory, open_memory


@pytest.fixture(scope="module")
def memory(campus: Path, fake_config: Path) -> Memory:
    return open_memory(campus, config=fake_config)


def test_views_are_sentences_of_their_nodes_and_none_is_told_twice(memory: Memory) -> None:
    corpus = memory.asker.corpus
    vector = memory.asker.embed(["wooden benches and trees"], "query")[0]
    views = Views(corpus).of(vector, np.arange(62), 12)
    assert len({view.text for view in views}) == 12
    assert all(view.text in corpus.texts[view.row] for view in views)
    best = int((corpus.sentence_vectors @ vector).argmax())
    assert views[0].row == corpus.sentence_rows[best]


def test_views_keep_to_their_rows_and_to_what_there_is(memory: Memory) -> None:
    corpus = memory.asker.corpus
    vector = memory.asker.embed(["trees"], "query")[0]
    assert {view.row for view in Views(corpus).of(vector, np.array([3, 4]), 50)} == {3, 4}
    assert Views(corpus).of(vector, np.array([], np.int64), 5) == []


def test_facts_are_counted_over_their_rows_and_chosen_by_the_question(memory: Memory) -> None:
    corpus, asked = memory.asker.corpus, list[str]()

    def embed(texts):  # type: ignore[no-untyped-def]
        asked.extend(texts)
        return memory.asker.embed(texts, "document")

    focus = Focus(corpus, embed)
    vector = memory.asker.embed(["trees"], "query")[0]
    facts = focus.facts(vector, np.arange(62), 4, 0.01)
    trees = next(f for f in facts if f.entry.words == ("tree",))
    column = focus.words.column[trees.entry]
    assert trees.views == int(focus.words.presence[:, [column]].sum())
    assert trees.of == 62
    assert f"{trees.views} of 62 views" in counts([trees])
    before = len(asked)
    focus.facts(vector, np.arange(62), 4, 0.01)
    assert len(asked) == before  # vectors of entries are kept
    assert focus.facts(vector, np.array([], np.int64), 4, 0.01) == []
    assert counts([]) == ""
