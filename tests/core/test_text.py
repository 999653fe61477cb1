"""Cleaning, words, sentences and hashes of text from the world."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.text import clean, content_hash, name_words, node_text, sentences, singular, words

LONG = 10**6
PARTS = st.lists(st.one_of(st.text(max_size=5), st.binary(max_size=5)), max_size=5)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("fireExtinguisher_wallMount_15", "fire extinguisher wall mount"),
        ("00DroneGate2x2-0", "drone gate x"),
        ("BaseCharacter_Walking2_5", "base character walking"),
        ("artFramed10", "art framed"),
        ("TVStand_3", "TV stand"),
        ("HTTPServer", "HTTP server"),
        ("snake_case__name_", "snake case name"),
        ("kebab-case name", "kebab case name"),
        ("101", "101"),
        ("12_34", "12 34"),
        ("", ""),
        ("___", ""),
        ("Café_Bänke2", "café bänke"),
        ("長椅_3", "長椅"),
    ],
)
def test_names_become_words(name: str, expected: str) -> None:
    assert name_words(name) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("One. Two! Three? Four", ["One.", "Two!", "Three?", "Four"]),
        ("No end mark", ["No end mark"]),
        ("", []),
        ("  \n ", []),
        ("Dr. Smith met Mr. Jones. They left.", ["Dr. Smith met Mr. Jones.", "They left."]),
        ("Trees, e.g. Oaks, i.e. Old ones, grow. Here.", ["Trees, e.g. Oaks, i.e. Old ones, grow.", "Here."]),
        ("The U.S. Army. Then", ["The U.S. Army.", "Then"]),
        ("St. Paul vs. St. Peter", ["St. Paul vs. St. Peter"]),
        ("Wait... what? Well... Yes", ["Wait... what?", "Well...", "Yes"]),
        ("So… Then", ["So…", "Then"]),
        ('A sign says "Stop." Cars wait.', ['A sign says "Stop."', "Cars wait."]),
        ('It reads "S Craig St." The sky is clear.', ['It reads "S Craig St."', "The sky is clear."]),
        ("Banner: “No Parking.” “Fire Lane.” A bus.", ["Banner: “No Parking.”", "“Fire Lane.”", "A bus."]),
        ("(One.) [Two.] Three.", ["(One.)", "[Two.]", "Three."]),
        ("A 2.5 m wall. 3 trees.", ["A 2.5 m wall.", "3 trees."]),
        ("Lower case. follows here.", ["Lower case. follows here."]),
        ("Über alles. Ändern wir. Éclair.", ["Über alles.", "Ändern wir.", "Éclair."]),
        ("Парк. Дерево. Скамья.", ["Парк.", "Дерево.", "Скамья."]),
        ("公园很大。长椅是空的！「好。」走", ["公园很大。", "长椅是空的！", "「好。」", "走"]),
        ("यह है। वह है।", ["यह है।", "वह है।"]),
        ("¿Dónde está? ¡Aquí! Bien.", ["¿Dónde está?", "¡Aquí!", "Bien."]),
        ("Line one.\nLine two.", ["Line one.", "Line two."]),
    ],
)
def test_sentences(text: str, expected: list[str]) -> None:
    assert sentences(text) == expected


@given(st.text())
def test_sentences_keep_every_visible_character_in_order(text: str) -> None:
    def squeezed(s: str) -> str:
        return "".join(s.split())

    parts = sentences(text)
    assert squeezed("".join(parts)) == squeezed(text)
    assert all(part == part.strip() and part for part in parts)


HOSTILE = {
    "no spaces": "a" * LONG,
    "quotes": '"' * LONG,
    "marks": "." * LONG,
    "mark then quotes": "." + '"' * LONG,
    "mark then spaces": "." + " " * LONG,
    "marks and quotes": '."' * (LONG // 2),
    "marks and spaces": ". " * (LONG // 2),
    "short sentences": "Ab. " * (LONG // 4),
    "acronym without end": "A." * (LONG // 2),
    "camel": "aB" * (LONG // 2),
    "apostrophes": "a'" * (LONG // 2),
    "full-width": "。」" * (LONG // 2),
    "combining marks": "a" + "\u0301\u0327" * (LONG // 2),
    "tibetan marks": "a" + "\u0f73" * LONG,
    "format characters": "\u200d" * LONG,
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_million_hostile_characters_are_linear(kind: str) -> None:
    # Anything quadratic here would take many minutes, and the run would not end.
    text = HOSTILE[kind]
    cleaned = clean(text)
    assert len(cleaned) <= len(text)
    assert "".join("".join(sentences(text)).split()) == "".join(text.split())
    assert len(words(text)) <= LONG
    assert len(name_words(text)) <= 2 * LONG


@given(st.text())
def test_clean_is_idempotent_normal_and_visible(text: str) -> None:
    cleaned = clean(text)
    assert clean(cleaned) == cleaned
    assert unicodedata.is_normalized("NFC", cleaned)
    assert cleaned == " ".join(cleaned.split())
    assert not any(unicodedata.category(c).startswith("C") for c in cleaned)


def test_clean_drops_what_cannot_be_seen() -> None:
    assert clean("a\x00b\x1b[31mc\u202ed\ufeff\u200de\u0301") == "ab[31mcdé"
    assert clean("\u2028two\u00a0 lines\r\n\tend ") == "two lines end"
    assert clean("e\u200d\u0301") == "é"
    assert len(clean("a" + "\u0316" * 100)) == 31
    assert clean("\ud800x") == "x"


def test_words_are_lower_case_and_without_punctuation() -> None:
    assert words("The robot's NDVI, 0.4: don’t! a_b") == ["the", "robot's", "ndvi", "0", "4", "don’t", "a", "b"]


@pytest.mark.parametrize(
    ("name", "caption", "expected"),
    [
        ("benchWood_2", "A  bench.", "A bench."),
        (None, "A bench.", "A bench."),
        ("benchWood_2", "\u200b ", "bench wood"),
        ("benchWood_2", None, "bench wood"),
        (None, None, ""),
        (" ", "", ""),
    ],
)
def test_node_text_prefers_the_caption(name: str | None, caption: str | None, expected: str) -> None:
    assert node_text(name, caption) == expected


@given(PARTS, PARTS)
def test_content_hash_tells_lists_of_parts_apart(a: list[str | bytes], b: list[str | bytes]) -> None:
    def raw(parts: list[str | bytes]) -> list[bytes]:
        return [p if isinstance(p, bytes) else p.encode("utf-8", "surrogatepass") for p in parts]

    assert (content_hash(*a) == content_hash(*b)) == (raw(a) == raw(b))
    assert len(content_hash(*a)) == 16


def test_content_hash_is_prefix_free() -> None:
    keys = [content_hash(*p) for p in [(), ("",), ("", ""), ("a", "bc"), ("ab", "c"), ("abc",), ("abc", "")]]
    assert len(set(keys)) == len(keys)
    assert content_hash("\ud800") != content_hash("?")


def test_content_hash_is_stable() -> None:
    assert content_hash("model", b"\x00text").hex() == "9d2b6a7a704826b9142d1f51cd2342ac"


@pytest.mark.parametrize(
    ("plural", "one"),
    [
        ("benches", "bench"),
        ("boxes", "box"),
        ("bushes", "bush"),
        ("trees", "tree"),
        ("cities", "city"),
        ("shoes", "shoe"),
        ("glass", "glass"),
        ("cactus", "cactus"),
        ("gas", "gas"),
        ("roses", "rose"),
    ],
)
def test_plurals_lose_their_ending(plural: str, one: str) -> None:
    assert singular(plural) == one
    assert singular(one) == one
