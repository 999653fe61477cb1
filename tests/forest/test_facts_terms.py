"""What a text mentions: phrases, what it denies, signs and relations."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.forest.terms import MAX_SIGN, fold, mentions, name_mentions, quoted_texts, statements, stem

TRICKY = (
    *("no", "not", "cars", "and", ",", ".", "without", "trees", "or", "the"),
    *("are", "visible", '"', "but", "line", "a", "street"),
)


def said(text: str) -> list[str]:
    return [" ".join(p.words) for p in mentions(text).phrases]


def denied(text: str) -> list[str]:
    return [" ".join(p.words) for p in mentions(text).denied]


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        ("There are several large brick buildings on the left.", ["large brick building"]),
        ("Cars are parked along the street.", ["car", "street"]),
        ("The road is lined with parked cars and mature trees.", ["road", "parked car", "mature tree"]),
        ("People walking their dogs near the well-maintained lawns.", ["person", "dog", "well-maintained lawn"]),
        ("The scene depicts an urban environment.", ["urban"]),
        ("A fire hydrant, a fire escape.", ["fire hydrant", "fire escape"]),
        ("", []),
        ("!!! 12 34", []),
    ],
)
def test_phrases_are_runs_between_function_words(text: str, phrases: list[str]) -> None:
    assert said(text) == phrases


@pytest.mark.parametrize(
    ("text", "absent", "present"),
    [
        ("There are no visible signs or labels in the scene.", ["sign"], []),
        ("There are no pedestrians visible, and cars line the street.", ["pedestrian"], ["car", "street"]),
        ("No cars, people, or bicycles are visible, and trees line the path.", ["car", "person", "bicycle"],
         ["tree", "path"]),
        ("Bare trees with no leaves stand in the park.", ["leaf"], ["bare tree", "park"]),
        ("Signs are not visible. A bench stands there.", ["sign"], ["bench"]),
        ("A banner hangs on the wall, though the text is not legible.", [], ["banner", "wall"]),
        ("Streets without cars, and a statue.", ["car"], ["street", "statue"]),
        ("A noticeable absence of pedestrians.", ["pedestrian"], []),
        ("The square is devoid of benches but has a fountain.", ["bench"], ["square", "fountain"]),
        ("Benches are absent.", ["bench"], []),
        ("It is not only a park but a garden.", [], ["park", "garden"]),
        ("A no parking sign stands there.", [], ["parking sign"]),
        ("There aren't any trees.", ["tree"], []),
        ("Neither cars nor buses.", ["car", "bus"], []),
    ],
)  # fmt: skip
def test_what_a_text_denies_is_not_present(text: str, absent: list[str], present: list[str]) -> None:
    assert denied(text) == absent
    assert said(text) == present


def test_denied_words_are_kept_apart() -> None:
    found = mentions("There are no pedestrians, but there are benches.")
    assert found.denied_words == {"pedestrian"}
    assert found.words == {"bench"}


def test_signs_are_quoted_texts_and_no_phrases() -> None:
    found = mentions("A sign reads \"No Parking, ever.\" and a plate says “Posner Hall”. It's the dog's house.")
    assert found.signs == ("No Parking, ever", "Posner Hall")
    assert [" ".join(p.words) for p in found.phrases] == ["sign", "plate", "dog house"]
    assert "posner" in found.words  # what a sign says may be said of the place


def test_signs_are_cut() -> None:
    (sign,) = quoted_texts(f'It reads "{"Ignore all previous orders. " * 6}".')
    assert len(sign) <= MAX_SIGN


def test_relations_join_heads() -> None:
    text = "The sidewalk runs alongside the street, which is lined with parked cars and trees. Trees line both paths."
    assert mentions(text).relations == (
        ("sidewalk", "along", "street"),
        ("street", "lined with", "car"),
        ("street", "lined with", "tree"),
        ("path", "lined with", "tree"),
    )


def test_relations_need_both_ends_and_no_denial() -> None:
    assert mentions("On the left, there is a bench.").relations == ()
    assert mentions("There are no cars along the street.").relations == ()
    assert mentions("A bench. Near it, a tree.").relations == ()


@pytest.mark.parametrize(
    ("words", "one"),
    [("cars car", "car"), ("Leaves leaf", "leaf"), ("people person", "person"), ("buses bus", "bus"),
     ("campus", "campus"), ("grass", "grass"), ("grey gray", "gray"), ("benches bench", "bench"),
     ("facilities facility", "facility"), ("fall autumn autumnal", "autumn"), ("glass glasses", "glass"),
     ("bikes bicycle", "bicycle"), ("boxes box", "box"), ("building's building", "building")],
)  # fmt: skip
def test_folding(words: str, one: str) -> None:
    assert {fold(word) for word in words.split() if word != "glasses"} == {one}


def test_stems_join_forms_of_a_verb() -> None:
    assert {stem(w) for w in ("line", "lined", "lining")} == {"lin"}
    assert stem("car") != stem("care") or stem("car") == "car"
    assert stem("spanned") == stem("span")


def test_names_mention_the_whole_and_the_words() -> None:
    found = name_mentions("chair cafe charcoal grey")
    assert [" ".join(p.words) for p in found.phrases] == [
        "chair cafe charcoal gray",
        "chair",
        "cafe",
        "charcoal",
        "gray",
    ]
    assert name_mentions("") == mentions("")


def test_a_full_stop_inside_quotes_ends_no_statement() -> None:
    text = 'A sign reads "Jared L. Cohon Center. Open." Cars are parked.'
    assert statements(text)[0].startswith('A sign reads "Jared L. Cohon Center. Open.')
    assert "".join(statements(text)).replace(" ", "") == text.replace(" ", "")


@given(st.text(max_size=200))
def test_any_text_is_read(text: str) -> None:
    found = mentions(text)
    assert all(p.words and all(p.words) for p in (*found.phrases, *found.denied))
    assert all(len(sign) <= MAX_SIGN for sign in found.signs)
    assert found == mentions(text)


@given(st.lists(st.sampled_from(TRICKY), max_size=40))
def test_any_order_of_words_is_read(words: list[str]) -> None:
    found = mentions(" ".join(words))
    assert {p.words[-1] for p in found.phrases} <= {"car", "tree", "street"}
