"""The index of words: where they stand, phrases, and what a request's words and pairs are worth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.retrieve.lexical import LexicalIndex, content, tokens

TEXTS = ("A green tractor by a red barn.", "A red tractor.", "", "Two benches near the tractor, all red.", "Benches!")
WORDS = st.lists(st.sampled_from(["red", "green", "tractor", "bench", "barn", "lamp"]), max_size=6)


def test_rows_and_phrases() -> None:
    index = LexicalIndex(TEXTS)
    assert index.rows("tractor").tolist() == [0, 1, 3]
    assert index.rows("bench").tolist() == [3, 4]
    assert index.rows("lamp").tolist() == []
    assert index.phrase_rows(["red", "tractor"]).tolist() == [1]
    assert index.phrase_rows(["green", "tractor", "by"]).tolist() == [0]
    assert index.phrase_rows([]).tolist() == []


def test_no_pair_spans_two_texts() -> None:
    index = LexicalIndex(("the end is red", "tractor first"))
    assert index.phrase_rows(["red", "tractor"]).tolist() == []
    assert index.matches("red tractor")[:, 2].tolist() == [0, 0]


def test_a_colour_belongs_to_what_follows_it() -> None:
    found = LexicalIndex(TEXTS).matches("Where is the nearest red tractor?")
    assert found[1, 2] == 1
    assert found[0, 2] == found[3, 2] == 0
    assert found[0, 1] == found[1, 1] == found[3, 1] == pytest.approx(1)  # all of them have both words


def test_words_of_asking_and_empty_requests_count_nothing() -> None:
    index = LexicalIndex(TEXTS)
    assert content("Please take me to the nearest bench.") == ["bench"]
    assert not index.matches("Where is it?").any()
    assert not index.matches("unicorn").any()
    assert LexicalIndex(()).matches("bench").shape == (0, 3)


def test_bm25_by_hand() -> None:
    found = LexicalIndex(("bench", "bench lamp lamp", "tree")).matches("bench")
    length = np.array([1, 3]) / (5 / 3)
    expected = 1 / (1 + 1.5 * (0.25 + 0.75 * length))
    assert found[:2, 0] == pytest.approx(expected)
    assert found[2].tolist() == [0, 0, 0]


@given(st.lists(WORDS, max_size=6), WORDS)
def test_shares_are_shares_and_need_the_words(said: list[list[str]], asked: list[str]) -> None:
    texts = [" ".join(words) for words in said]
    found = LexicalIndex(texts).matches(" ".join(asked))
    assert found.shape == (len(texts), 3)
    assert ((found >= 0) & (found <= 1 + 1e-9)).all()
    for row, words in zip(found, said, strict=True):
        assert (row[1] > 0) == bool(set(words) & set(asked))


def test_tokens_are_compared_in_the_singular() -> None:
    assert tokens("Boxes, berries & BUSES") == ["box", "berry", "buse"]
