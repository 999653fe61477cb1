"""What one text mentions: phrases, things it says are absent, quoted signs and relations, found without a model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from erag.core.text import clean, sentences
from erag.forest import lexicon as lex

MAX_SIGN = 48  # characters kept of a quoted sign
MAX_PHRASE = 5  # words kept of a phrase, the last ones

QUOTED = re.compile(
    r"\"([^\"]{1,200})\"|“([^”]{1,200})”|«([^»]{1,200})»|(?<!\w)'([^']{1,80})'(?!\w)|(?<!\w)‘([^’]{1,80})’(?!\w)"
)
_TOKEN = re.compile(r"[^\W_]++(?:['’-][^\W_]++)*+|[.;:!?()…—–\"]|,")
_HARD = frozenset('.;:!?()…—–"')
_BOUNDARY = (
    lex.DETERMINERS
    | lex.QUANTITIES
    | lex.AUXILIARIES
    | lex.PREPOSITIONS
    | lex.JOINERS
    | lex.PRONOUNS
    | lex.TALK
    | lex.VERBS
)
_FUNCTION = _BOUNDARY - lex.TALK - lex.VERBS
_ENDS_DENIAL = lex.AUXILIARIES | lex.CLAUSE_BREAKS | (lex.PREPOSITIONS - {"of"})
_RESETS_LINK = lex.AUXILIARIES | lex.TALK | lex.VERBS | lex.CLAUSE_BREAKS
_SHARED_LINKS = frozenset({"lined with", "surrounded by", "bordered by", "flanked by", "covered with"})
_ABSENT = frozenset({"absent", "missing"})
_BEFORE_PLAIN_S = ("ss", "us", "is", "'s")

Words = tuple[str, ...]
Relation = tuple[str, str, str]  # subject, how it stands, object; both as folded heads


@dataclass(frozen=True, slots=True)
class Phrase:
    """A noun phrase: folded words, head last, and the head as written where that was a plural, else empty."""

    words: Words
    plural: str = ""


@dataclass(frozen=True, slots=True)
class Mentions:
    """What a text says: `phrases` it affirms and `denied` ones, `signs` it quotes, `relations` between heads.

    `words` and `denied_words` are the stems of all content words on either side, for checking statements.
    """

    phrases: tuple[Phrase, ...] = ()
    denied: tuple[Phrase, ...] = ()
    signs: tuple[str, ...] = ()
    relations: tuple[Relation, ...] = ()
    words: frozenset[str] = frozenset()
    denied_words: frozenset[str] = frozenset()


def mentions(text: str) -> Mentions:
    """What a caption or a summary mentions. English; linear in the length of the text.

    Phrases are runs of words between function words, verbs of description and punctuation. `no`, `without`,
    `not … visible` and the like deny what they govern, up to the end of their clause or noun list.
    """
    plain, signs = _without_signs(clean(text))
    scanner = _Scanner([t.lower() for t in _TOKEN.findall(plain)])
    scanner.scan()
    return scanner.result(signs)


def name_mentions(name: str) -> Mentions:
    """What an object's name (already split into words) mentions: the whole name and each of its words."""
    spoken = tuple(fold(w) for w in _TOKEN.findall(name.lower()) if w not in _HARD and w != ",")
    if not spoken:
        return Mentions()
    whole = Phrase(spoken[:MAX_PHRASE])
    parts = tuple(Phrase((w,)) for w in spoken if w not in _FUNCTION and not w.isdigit() and len(w) > 1)
    phrases = parts if len(spoken) == 1 else (whole, *parts)
    return Mentions(phrases, words=frozenset(_stems(spoken)))


def with_objects(said: Mentions, objects: Sequence[str]) -> Mentions:
    """`said`, and the objects (noun phrases) that were seen beside it, each unless it is said already."""
    known = {phrase.words for phrase in said.phrases}
    named = [name_mentions(name) for name in objects]
    new = dict.fromkeys(m.phrases[0] for m in named if m.phrases and m.phrases[0].words not in known)
    words = frozenset[str]().union(*(m.words for m in named))
    return replace(said, phrases=(*said.phrases, *new), words=said.words | words)


def quoted_texts(text: str) -> tuple[str, ...]:
    """The texts that `text` quotes, cut to `MAX_SIGN` characters, without outer punctuation."""
    return _without_signs(clean(text))[1]


def statements(text: str) -> list[str]:
    """The sentences of a text; a full stop inside a quoted text ends none."""
    whole = QUOTED.sub(lambda match: match[0].translate(_HIDDEN), text)
    return [sentence.translate(_SHOWN) for sentence in sentences(whole)]


_HIDDEN = str.maketrans(".!?", "\ue000\ue001\ue002")  # private characters: no text that was cleaned has them
_SHOWN = str.maketrans("\ue000\ue001\ue002", ".!?")


def _without_signs(text: str) -> tuple[str, tuple[str, ...]]:
    found: list[str] = []

    def keep(match: re.Match[str]) -> str:
        inner = next(g for g in match.groups() if g is not None).strip(" .,;:!?")
        found.append(inner[:MAX_SIGN].strip())
        return ' " '

    plain = QUOTED.sub(keep, text)
    return plain, tuple(s for s in found if any(c.isalnum() for c in s))


@lru_cache(maxsize=1 << 16)
def fold(word: str) -> str:
    """`word` in lower case, singular, in one spelling: `Leaves` and `leaf` are one word, `grey` and `gray` too."""
    plain = word.lower().replace("’", "'").removesuffix("'s")
    plain = lex.SEASONS.get(plain) or lex.SYNONYMS.get(plain, plain)
    if "-" in plain:
        head, tail = plain.rsplit("-", 1)
        return f"{head}-{fold(tail)}"
    return lex.SYNONYMS.get(single := _singular(plain), single)


def _singular(word: str) -> str:
    if word in lex.IRREGULAR:
        return lex.IRREGULAR[word]
    if len(word) < 4 or not word.endswith("s") or word in lex.UNCOUNTED or word.endswith(_BEFORE_PLAIN_S):
        return word
    if word.endswith("ies") and len(word) > 4:
        return f"{word[:-3]}y"
    if word.endswith(("sses", "xes", "zes", "ches", "shes")):
        return word[:-2]
    return word[:-1]


def _plural(word: str) -> str:
    return word if word in lex.IRREGULAR or (word.endswith("s") and _singular(word) != word) else ""


@lru_cache(maxsize=1 << 16)
def stem(word: str) -> str:
    """A crude stem of a folded word for comparison only: `lined`, `lining` and `line` agree."""
    for ending in ("ing", "ed", "ly"):
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            word = word[: -len(ending)]
            if len(word) > 3 and word[-1] == word[-2] and word[-1] not in "ls":
                word = word[:-1]
            break
    return word[:-1] if word.endswith("e") and len(word) > 3 else word


def content(word: str) -> bool:
    """Whether a word in lower case can be part of a phrase."""
    if word in _BOUNDARY or (fold(word) in lex.TALK and word not in lex.LIGHT) or len(word) < 2 or word[0].isdigit():
        return False
    return not word.endswith("ly") or word in lex.ADJECTIVES_IN_LY


def _stems(folded: Iterable[str]) -> Iterator[str]:
    for word in folded:
        yield stem(word)
        if "-" in word:
            yield from (stem(fold(part)) for part in word.split("-"))


def _sign_stems(signs: Iterable[str]) -> frozenset[str]:
    return frozenset(_stems(fold(w) for sign in signs for w in _TOKEN.findall(sign.lower()) if w not in _HARD))


def _verbal(word: str) -> bool:
    """Whether a word looks like a participle, which may describe what follows but is no head."""
    if word.endswith("ing"):
        return word not in lex.NOUNS_IN_ING
    return word.endswith("ed") and word not in lex.NOUNS_IN_ED


class _Scanner:
    """Reads the tokens of one text from left to right."""

    def __init__(self, tokens: Sequence[str]) -> None:
        self._tokens = tokens
        self._run: list[str] = []
        self._phrases: list[tuple[Phrase, bool]] = []  # with: denied
        self._words: list[tuple[str, bool]] = []
        self._relations: list[Relation] = []
        self._denying: str | None = None  # the word that denies
        self._clause = (0, 0)  # phrases and words that stood before this clause
        self._subject: str | None = None
        self._link: tuple[str, bool] | None = None
        self._shared: tuple[str, str] | None = None  # subject and link that `and` carries on

    def scan(self) -> None:
        for i, word in enumerate(self._tokens):
            before = self._tokens[i - 1] if i else "."
            if word in _HARD or word == ",":
                self._punctuation(i, word)
            elif word in lex.NEGATORS or word.endswith("n't"):
                self._negate(i, word, before)
            elif word in _ABSENT:
                self._deny_back(word)
            elif content(word):
                self._run.append(word)
                self._words.append((fold(word), self._denying is not None))
            else:
                self._boundary(word, before)
        self._flush()

    def result(self, signs: tuple[str, ...]) -> Mentions:
        said = tuple(p for p, denied in self._phrases if not denied)
        denied = tuple(p for p, denied in self._phrases if denied)
        return Mentions(
            said,
            denied,
            signs,
            tuple(self._relations),
            frozenset(_stems(w for w, off in self._words if not off)) | _sign_stems(signs),
            frozenset(_stems(w for w, off in self._words if off)),
        )

    def _punctuation(self, at: int, mark: str) -> None:
        self._flush()
        if mark in _HARD:
            self._subject = None
        if mark in _HARD or self._denying in ("not", "cannot") or not self._list_goes_on(at + 1):
            self._denying = None
            self._clause = (len(self._phrases), len(self._words))
        self._link = self._shared = None

    def _list_goes_on(self, at: int) -> bool:
        """Whether a comma at `at - 1` stands in a denied list: `no cars, people, or signs`."""
        if self._denying is None:
            return False
        for word in self._tokens[at : at + 12]:
            if word in ("or", "nor"):
                return True
            if word in _HARD or word in _ENDS_DENIAL or word in lex.DETERMINERS:
                return False
        return False

    def _negate(self, at: int, word: str, before: str) -> None:
        self._flush()
        following = self._tokens[at + 1] if at + 1 < len(self._tokens) else ""
        if (before in ("a", "the") and word == "no") or following in ("only", "just", "longer", "doubt"):
            return  # a `no parking` sign; not only … but also
        self._denying = "not" if word.endswith("n't") else word
        self._link = self._shared = None

    def _boundary(self, word: str, before: str) -> None:
        self._deny_back(word)
        if word[0].isdigit():
            self._words.append((word, self._denying is not None))
        if self._denying is not None and self._ends_denial(word, before):
            self._denying = None
        if word in lex.CLAUSE_BREAKS:
            self._clause = (len(self._phrases), len(self._words))
        if word in lex.RELATIONS:
            self._link = lex.RELATIONS[word] if before != "," else None
            self._shared = None
        elif word in _RESETS_LINK:
            self._link = None
            self._shared = None
        elif word in ("and", "of") and self._shared is None:
            self._link = None

    def _ends_denial(self, word: str, before: str) -> bool:
        if self._denying in ("not", "cannot"):
            return word in lex.CLAUSE_BREAKS
        return word in _ENDS_DENIAL or (word in lex.DETERMINERS and before in (",", "and"))

    def _deny_back(self, word: str) -> None:
        """`signs are not visible`: what stood before the negation in this clause is denied."""
        self._flush()
        if word in _ABSENT or (word in lex.SEEN and self._denying in ("not", "cannot")):
            first, first_word = self._clause
            self._phrases[first:] = [(p, True) for p, _ in self._phrases[first:]]
            self._words[first_word:] = [(w, True) for w, _ in self._words[first_word:]]

    def _flush(self) -> None:
        run, self._run = self._run, []
        for words in _split(run):
            self._add(words)

    def _add(self, words: Sequence[str]) -> None:
        folded = tuple(fold(w) for w in words[-MAX_PHRASE:])
        self._phrases.append((Phrase(folded, _plural(words[-1])), self._denying is not None))
        if self._denying is not None:
            self._link = self._shared = None
            return
        head = " ".join(folded[-2:]) if folded[-1] in lex.LIGHT else folded[-1]
        self._relate(head)
        self._subject = head

    def _relate(self, head: str) -> None:
        if self._link is not None and self._subject is not None and self._subject != head:
            how, swapped = self._link
            first, second = (head, self._subject) if swapped else (self._subject, head)
            self._relations.append((first, how, second))
            self._shared = (first, how) if how in _SHARED_LINKS and not swapped else None
        elif self._shared is not None and self._shared[0] != head:
            self._relations.append((*self._shared, head))
        self._link = None


def _split(run: Sequence[str]) -> Iterator[list[str]]:
    """The phrases of a run: a participle begins a new one (`cars | parked`), and none ends in a participle."""
    part: list[str] = []
    for word in (*run, ""):
        if part and (not word or _verbal(word)):
            while part and _verbal(part[-1]):
                part.pop()
            if part:
                yield part
            part = []
        part.append(word)
