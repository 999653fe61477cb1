"""What a query wants, and the conditions it sets in words: not in the view, near, away from. Rules, no model."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from erag.core.text import clean, word_set
from erag.forest import lexicon as lex
from erag.forest.terms import QUOTED
from erag.retrieve.lexical import content

How = Literal["not", "near", "far"]
SAID: Mapping[How, str] = {"not": "not", "near": "near", "far": "away from"}
MOST_CLAUSES, MOST_TOKENS, MOST_WORDS = 4, 200, 6  # clauses read of a query; its tokens; words of a thing

_TRIGGERS: Mapping[How, tuple[str, ...]] = {
    "near": (
        "near", "near to", "next to", "close to", "close by", "beside", "adjacent to", "alongside", "by", "with",
        "in the vicinity of", "not far from", "not too far from", "not very far from", "not far away from",
        "not too far away from", "a short walk from",
    ),
    "far": (
        "away from", "far from", "far away from", "well away from", "a long way from", "at a distance from",
        "out of earshot of", "not near", "not next to", "not close to", "not too close to", "not by", "not beside",
        "nowhere near", "not anywhere near", "nowhere close to",
    ),
    "not": (
        "without", "but without", "but no", "and no", "with no", ", no", "with neither", "has neither", "has no",
        "have no", "not have", "there is no", "there are no", "not", "but not", "and not", "other than",
        "except", "except for", "apart from", "instead of", "rather than", "anything but", "anywhere but", "free of",
        "free from", "avoiding", "lacking", "out of sight of",
    ),
}  # fmt: skip
_WITHIN = ("at", "in", "on", "under", "beneath", "inside", "among", "behind", "below", "between")
_STARTS: Mapping[tuple[str, ...], How] = {
    **{("not", place): "not" for place in _WITHIN},
    **{tuple(t.split()): how for how, said in _TRIGGERS.items() for t in said},
}
_LONGEST = max(map(len, _STARTS))
_NEEDS_DETERMINER = frozenset({"by", "not by", "not", "but not", "and not"})
_DETERMINERS = word_set("the a an any this that these those my our your its their some another one")
_NOUN_FOLLOWS = _DETERMINERS | set(_WITHIN)
_POSSESSIVES = word_set("my our your its their his her")
_SKIPPED = _DETERMINERS | _POSSESSIVES | word_set("all too so as many much other lots of more most very single")
_NO_THINGS = lex.PRONOUNS | word_set("""
    me him her them us nothing anything something everything everyone anyone someone anybody somebody nobody one ones
    doubt problem problems question delay fail money help hurry haste trouble hassle luck effort warning permission
    notice exception cost charge success time home town way hour end look name midnight noon
    position location somewhere anywhere else having need needing work use service order place spot mine ours hers
    theirs
""")
_IDIOMS = {"by": word_set("way time hour book bucket name means end day week month look dozen looks hand")}
_TO_BE_SEEN = word_set("seeing hearing climbing meeting")  # without seeing cars: the cars are what is not wanted
_TO_DO = (("having", "to", "climb"), ("having", "to", "see"), ("having", "to", "use"), ("needing", "to", "climb"))
_TAKEN = word_set(
    "keep keeps kept take takes taking taken throw carry give blow run ran runs put go goes went ride drive drove"
)
_PASSIVE = word_set("made lit built run driven written taken given sold shown known hidden held drawn eaten worn")
_STANDING = word_set("parked located situated placed seated planted positioned")
_DENIES_VERB = word_set("""
    am i'm was were do does did can could will would should must may might if why or have has had i we you they he she
    cannot don't
""")
_ASIDE = word_set("nearby around please either though anywhere there")
_OF_IT = re.compile(
    r"(?:(?:in|to) (?:front|sight|view|the way) of|(?:next|close) to|"
    r"on|in|at|under|near|beside|by|around|behind|inside)"
    r" (?:it|them) "
)
_AROUND = word_set("nearby around")
_DANGLING = word_set("that that's which is are does do and but where there located situated placed with it's")
_ACTS = word_set("""
    sit read rest eat drink wait watch play walk talk lie sleep meet see get take have buy go relax tell show bring park
    study enjoy look find stay stop
""")
_ONE_WORD = (
    _SKIPPED
    | word_set("me him them us mine ours hers theirs")
    | lex.PREPOSITIONS
    | lex.JOINERS
    | lex.PRONOUNS
    | lex.AUXILIARIES
    | _ASIDE
    | word_set("want wants need needs")
)
_FIRST_PERSON = word_set("i i'm i've i'd i'll my we we're we've our")
_TELLS = word_set(
    "it it's he she they there there's this that you everyone everybody somebody someone his her their your"
)
_ASKS_ELSE = word_set("nothing nobody none no never what why how when who")  # begin what no condition is read from
_WISHES = word_set("""
    want wants need needs looking find prefer rather search searching hope hoping where show take bring guide can could
    wish seek seeking somewhere anywhere place spot would
""")
_OWN = word_set("a an single") | _POSSESSIVES  # without a car: what the asker has not, rather than what is to be seen
_BUT_THE_ONE: Mapping[tuple[str, ...], How] = {
    **{(word,): "not" for word in ("at", "in", "on", "under", "around", "behind", "inside", "with")},
    **{(word,): "far" for word in ("near", "by", "beside")}, ("next", "to"): "far", ("close", "to"): "far",
    ("in", "front", "of"): "not",
}  # fmt: skip
_HOW_STANDING = word_set("stand stands standing located situated lie lies right directly anywhere too very")
_TOKEN = re.compile(r"[\ue100-\ue2ff]|[^\W_]+(?:['’-][^\W_]+)*|[,.;:!?()…—–]")
_LOOSE = re.compile(r" ([,.;:!?])")
_MARKS = frozenset(",.;:!?()…—–")
_FREE = re.compile(r"(car|traffic|people|stair|step|crowd|noise)s?-free")
_FIRST_HIDDEN = 0xE100


@dataclass(frozen=True, slots=True)
class Clause:
    """A condition: none of `things` is `not` in the view; one of them is `near`; all are `far`."""

    how: How
    things: tuple[str, ...]

    def __str__(self) -> str:
        return f"{SAID[self.how]}: {' or '.join(self.things)}"


@dataclass(frozen=True, slots=True)
class Clauses:
    """What a query wants, empty where it is conditions alone, and these; without any `wanted` is the query."""

    wanted: str
    clauses: tuple[Clause, ...] = ()


@dataclass(frozen=True, slots=True)
class _Token:
    said: str  # in lower case
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class _Cut:
    """Clauses and the tokens [start, end) that say them."""

    clauses: tuple[Clause, ...]
    start: int
    end: int


def read_clauses(text: str) -> Clauses:
    """The clauses of a request in English; linear in its length.

    Left alone are quoted texts, what is near or far from the asker (that is location), and what a first person tells of
    itself in a sentence that wishes for nothing (`my dog ran off near the pond`).
    """
    plain, quotes = _hidden(clean(text))
    tokens = [token for match in _TOKEN.finditer(plain) for token in _tokens(match)]
    cuts = _cuts(tokens[:MOST_TOKENS])
    if not cuts:
        return Clauses(text)
    clauses = [_shown_clause(clause, quotes) for cut in cuts for clause in cut.clauses]
    wanted = _shown(_without(plain, tokens, cuts), quotes)
    return Clauses(wanted if content(wanted) else "", tuple(dict.fromkeys(clauses)))


def _tokens(match: re.Match[str]) -> Iterator[_Token]:
    """A word or a mark; `isn't` is two words."""
    said, start, end = match[0].lower().replace("’", "'"), match.start(), match.end()
    if said.endswith("n't") and len(said) > 3:
        yield _Token(said[:-3], start, end - 3)
        yield _Token("not", end - 3, end)
    else:
        yield _Token(said, start, end)


def _hidden(text: str) -> tuple[str, tuple[str, ...]]:
    """The text with a private character for each quoted text, and these."""
    quotes: list[str] = []

    def hide(match: re.Match[str]) -> str:
        if len(quotes) >= MOST_TOKENS:
            return match[0]
        quotes.append(match[0])
        return chr(_FIRST_HIDDEN + len(quotes) - 1)

    bare = "".join(" " if _FIRST_HIDDEN <= ord(c) < _FIRST_HIDDEN + 0x200 else c for c in text)
    return QUOTED.sub(hide, bare), tuple(quotes)


def _shown(text: str, quotes: Sequence[str]) -> str:
    return text.translate({_FIRST_HIDDEN + i: quote for i, quote in enumerate(quotes)})


def _shown_clause(clause: Clause, quotes: Sequence[str]) -> Clause:
    return Clause(clause.how, tuple(_shown(thing, quotes) for thing in clause.things))


def _cuts(tokens: Sequence[_Token]) -> list[_Cut]:
    said, found, at = [t.said for t in tokens], list[_Cut](), 0
    told = _told(said)
    while at < len(said) and len(found) < MOST_CLAUSES:
        cut = None if told[at] else _clause(said, at)
        if cut is None:
            at += 1
        else:
            found.append(cut)
            at = cut.end
    return found


def _told(said: Sequence[str]) -> list[bool]:
    """Of each token whether its sentence tells or asks something else than for a place: no condition is read there."""
    out: list[bool] = []
    ends = [i + 1 for i, word in enumerate(said) if word in ".!?;"]
    for start, end in zip([0, *ends], [*ends, len(said)], strict=True):
        sentence, first = set(said[start:end]), said[start] if start < end else ""
        tells = bool(sentence & _FIRST_PERSON) or first in _TELLS
        out += [first in _ASKS_ELSE or (tells and not sentence & _WISHES)] * (end - start)
    return out


def _clause(said: Sequence[str], at: int) -> _Cut | None:
    if free := _FREE.fullmatch(said[at]):
        return _Cut((Clause("not", (free[1],)),), at, at + 1)
    for length in range(min(_LONGEST, len(said) - at), 0, -1):
        words = tuple(said[at : at + length])
        how = _STARTS.get(words)
        if how is not None:
            return _read(said, at, at + length, how)
    return None


def _read(said: Sequence[str], at: int, after: int, how: How) -> _Cut | None:
    """The clauses whose trigger is the tokens [at, after); None where it only looks like one."""
    if not _means_it(said, at, after):
        return None
    if how == "near" and at > 1 and said[at - 2] == "not" and said[at - 1] in _HOW_STANDING:
        at, how = at - 2, "far"
    after, how = _but_the_one(said, after, how)
    start = _first_word(said, after, how)
    if start is None or said[start] in _IDIOMS.get(said[at], ()):
        return None
    things, end = _things(said, start)
    if not things:
        return None
    stop = _end_of_aside(said, end)
    around = bool(_AROUND & set(said[end:stop]))
    if said[at] == "with" and how == "near" and not around:
        return None
    how = "far" if how == "not" and around else how
    each = how == "near" and "or" not in said[start:end]
    return _Cut(tuple(Clause(how, (t,)) for t in things) if each else (Clause(how, things),), at, stop)


def _but_the_one(said: Sequence[str], at: int, how: How) -> tuple[int, How]:
    """Behind `the one at`, and what that makes of a `not`: far from the canteen, if the one next to it is out."""
    one = at + 1 if said[at : at + 1] == ["the"] else at
    if how != "not" or tuple(said[one : one + 1]) not in (("one",), ("ones",)):
        return at, how
    for words, meant in _BUT_THE_ONE.items():
        if tuple(said[one + 1 : one + 1 + len(words)]) == words:
            return one + 1 + len(words), meant
    return at, how


def _means_it(said: Sequence[str], at: int, after: int) -> bool:
    """Whether the trigger [at, after) is one after the words before it, and before those behind it."""
    trigger, before = " ".join(said[at:after]), said[at - 1] if at else ","
    earlier, first = said[at - 2] if at > 1 else ",", said[after] if after < len(said) else "."
    bare = trigger.removeprefix("not ") in _WITHIN and before not in (",", "but", "and", "is", "are")
    if (bare or trigger in _NEEDS_DETERMINER) and first not in _DETERMINERS:
        return False
    if trigger == "by":
        passive = before in _PASSIVE or (before.endswith("ed") and before not in lex.NOUNS_IN_ED)
        return before in _STANDING or not passive
    if trigger == "away from":
        return not _TAKEN & set(said[max(at - 3, 0) : at])
    if trigger.startswith(("ha", "there")):
        return before in ("that", "which", "who", "where")
    if trigger == "without" and first in _OWN:
        return not _FIRST_PERSON & set(said[:at])
    if trigger == "not have":
        return before in ("do", "does") and earlier in ("that", "which", "who")
    if trigger.startswith("not") and before in ("is", "are", "it's", "that's"):
        return before == "that's" or earlier in ("that", "which", "who", "where")
    if trigger.startswith("not"):
        return before not in _DENIES_VERB
    return before != "not"  # not without: two denials are none


def _end_of_aside(said: Sequence[str], at: int) -> int:
    """Behind what may follow a thing without naming another: `nearby`, `in front of it`."""
    while at < len(said):
        of_it = _OF_IT.match(" ".join([*said[at : at + 5], ""]))
        if of_it is None and said[at] not in _ASIDE:
            break
        at += 1 if of_it is None else len(of_it[0].split())
    return at


def _first_word(said: Sequence[str], at: int, how: How) -> int | None:
    """Where the thing begins behind a trigger; None where no thing follows."""
    for doing in _TO_DO:
        if tuple(said[at : at + len(doing)]) == doing:
            at += len(doing)
    if at < len(said) and said[at] in _TO_BE_SEEN:
        at += 1
    while at < len(said) and said[at] in _SKIPPED:
        at += 1
    if at >= len(said) or said[at] in _MARKS or said[at] in _NO_THINGS or said[at][0].isdigit():
        return None
    verbal = said[at].endswith("ing") and said[at] not in lex.NOUNS_IN_ING
    return None if verbal and how == "not" and said[at - 1] not in _NOUN_FOLLOWS else at


def _things(said: Sequence[str], at: int) -> tuple[tuple[str, ...], int]:
    """The things listed from `at` on, and where the list ends: nouns joined by `or`, `nor`, `and`, and by commas."""
    things: list[str] = []
    while True:
        end = _noun_end(said, at)
        if end == at:
            break
        things.append(" ".join(said[at:end]))
        follows = _joined(said, end)
        if follows is None:
            return tuple(things), end
        at = follows
    return tuple(things), at


def _noun_end(said: Sequence[str], at: int) -> int:
    """The end of the noun phrase at `at`: words that name, and `of` with what follows it."""
    end = at
    while end < len(said) and end - at < MOST_WORDS and not _breaks(said, at, end):
        end += 1
    while end > at and (said[end - 1] in _SKIPPED or said[end - 1] in _ONE_WORD):
        end -= 1
    return end


def _breaks(said: Sequence[str], start: int, at: int) -> bool:
    word = said[at]
    if word == "of":
        return at == start
    if word in _SKIPPED:
        return said[at - 1] != "of"
    return word in _MARKS or word in _ONE_WORD


def _joined(said: Sequence[str], at: int) -> int | None:
    """Where the next noun of a list begins that goes on at `at`; None where it ends."""
    if at >= len(said) or said[at] not in ("or", "nor", "and", ",", "with"):
        return None
    if said[at] == "with" or (said[at] == "," and not _list_goes_on(said, at + 1)):
        return None
    if _begins_clause(said, at) or _begins_clause(said, at + 1):
        return None
    follows = at + 2 if said[at] == "," and said[at + 1 : at + 2] in (["or"], ["nor"], ["and"]) else at + 1
    start = _first_word(said, follows, "not")
    return None if start is None or said[start] in _ACTS or _noun_end(said, start) == start else start


def _list_goes_on(said: Sequence[str], at: int) -> bool:
    for word in said[at : at + 6]:
        if word in ("or", "nor"):
            return True
        if word != "," and (word in _MARKS or word in _ONE_WORD - _SKIPPED):
            return False
    return False


def _begins_clause(said: Sequence[str], at: int) -> bool:
    return any(tuple(said[at : at + n]) in _STARTS for n in range(1, _LONGEST + 1))


def _without(text: str, tokens: Sequence[_Token], cuts: Sequence[_Cut]) -> str:
    """The text without the clauses and the words that only led to them."""
    kept = " ".join(" ".join(_kept(text, tokens, cuts)).split())
    return _LOOSE.sub(r"\1", kept).strip(" ,;:-–—")


def _kept(text: str, tokens: Sequence[_Token], cuts: Sequence[_Cut]) -> Iterator[str]:
    begin, first = 0, 0
    for cut in cuts:
        last = cut.start
        while last > first + (first == 0) and (tokens[last - 1].said in _DANGLING or tokens[last - 1].said == ","):
            last -= 1
        yield text[begin : tokens[last].start] if last < len(tokens) else text[begin:]
        begin, first = tokens[cut.end - 1].end, cut.end
    yield text[begin:]
