"""What a question asks about time, change and number, and of which thing."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from erag.aware.things import Name
from erag.core.text import words
from erag.forest import lexicon as lex
from erag.forest.terms import fold, mentions

Aspect = Literal["last", "first", "ago", "gone", "new", "moved", "changed", "still", "count"]

_SEE = (
    r"(?:see|saw|seen|spot|spotted|notice|noticed|observe|observed|sight|sighted|sighting|record|recorded|"
    r"meet|met|pass|passed|come across|encounter(?:ed)?|photograph(?:ed)?)"
)
_THING_GONE = (
    r"(?:gone|disappeared|vanished|missing|removed|taken away|cleared away|no longer|not (?:there|here) any ?more|lost)"
)
_THING_NEW = (
    r"(?:new|newly|appeared|added|arrived|turned up|not (?:there|here) before|additional|were not there|was not there)"
)
_THING_MOVED = (
    r"(?:moved|shifted|relocated|rearranged|been put elsewhere|changed (?:its |their )?places?|another place now)"
)
_CHANGED = r"(?:changed|change|changes|differ|differs|different|difference|differences|compare|compared|altered)"
_ABOUT_TIME = (
    r"(?:since|visit|visits|between|before|any ?more|now|meanwhile|last time|tour|yesterday|ago|compared|times|"
    r"earlier|has|have)"
)

# The first that fits decides; {t} is where the thing asked for stands.
_PATTERNS: tuple[tuple[Aspect, str], ...] = (
    ("ago", r"^how (?:long ago|many (?:days|hours|weeks|months|minutes) ago|much time has passed|"
            r"long (?:has it been|is it) since|old is)\b(?:.*?\b(?:see|saw|seen)\b)?(?P<t>.+)"),
    ("ago", rf"^how (?:long ago|many (?:days|hours|weeks|months|minutes) ago) "
            rf"(?:was|were) (?P<t>.*?) (?:last )?{_SEE}\b"),
    ("first", rf"\b(?:first|for the first time)\b.*\b{_SEE}\b(?P<t>.*)|\bwhen (?:was|were) (?P<t2>.*?) first {_SEE}\b"),
    ("first", rf"\b{_SEE}\b(?P<t>.*) for the first time\b"),
    ("last", rf"\b(?:last|latest|most recently|most recent)\b(?: time)?.*?\b{_SEE}\b(?: of)?(?P<t>.*)"),
    ("last", rf"\b(?:where|when) (?:was|were|is|are) (?P<t>.*?) (?:last|most recently)\b(?: {_SEE})?"),
    ("last", rf"\bwhere (?P<t>(?:the|a|an|my|our) .*?) (?:was|were) (?:last )?{_SEE}\b"),
    ("last", rf"\b{_SEE}\b(?P<t>.*?) (?:last|most recently|the last time)\b"),
    ("last", r"^(?:what is |tell me )?the last (?:known )?(?:place|position|location|whereabouts) of (?P<t>.*)"),
    ("last", rf"^(?:when|at what time|on which day|on what day|what day|what time)\b"
             rf".*?\b(?:you|the robot|we) {_SEE}\b(?P<t>.*)"),
    ("last", rf"^(?:when|at what time|on which day) (?:was|were|is|are) (?P<t>.*?) {_SEE}\b"),
    ("last", rf"\bwhen (?P<t>(?:the|a|an|my|our) .*?) (?:was|were) (?:last )?{_SEE}\b"),
    ("last", rf"^where did (?:you|the robot) {_SEE}\b(?P<t>.*)"),
    ("still", r"^(?:is|are) (?P<t>.*?) (?:still|gone|missing)\b"),
    ("still", r"\bstill (?:there|here|around|standing)\b(?P<t>)"),
    ("still", rf"^(?:has|have) (?P<t>(?:the|a|an|my|our|any) .*?) (?:been )?(?:{_THING_GONE[3:-1]}|moved)\b"),
    ("count", r"^(?:so |and )?how many (?P<t>.*)|"
              r"(?:^(?:please )?count|\bnumber of|\btotal of)\b(?: all)?(?: the)?(?P<t2>.*)"),
)  # fmt: skip
_KINDS: tuple[tuple[Aspect, str], ...] = (
    ("gone", _THING_GONE), ("moved", _THING_MOVED), ("new", _THING_NEW), ("changed", _CHANGED),
)  # fmt: skip
_SHORT = re.compile(
    r"^(?:what is|what's|anything|is anything|is something|what are) (new|missing|gone)\b(?: here| there| now)*$"
)
_ASKING = re.compile(
    r"^(?:what|which|how|is|are|has|have|did|does|tell|list|name|describe|"
    r"show me what|show me which|explain|summari[sz]e|anything|any|compare|was|were|do)\b"
)
_NOT_THINGS = frozenset(
    {"left", "time", "visit", "robot", "thing", "object", "item", "last", "first", "place", "ago", "day", "hour",
     "number", "count", "there", "here", "today", "yesterday", "minute", "second", "week", "month", "year", "metre",
     "meter", "percent", "way", "memory", "map", "you"}
)  # fmt: skip
_FUNCTION = lex.DETERMINERS | lex.QUANTITIES | lex.AUXILIARIES | lex.PREPOSITIONS | lex.JOINERS | lex.PRONOUNS


@dataclass(frozen=True, slots=True)
class Asked:
    """The aspect of a question, and the name and the words of the thing it asks about, where it names one."""

    aspect: Aspect | None = None
    thing: Name = ()
    text: str = ""

    @property
    def changes(self) -> bool:
        """Whether visits are compared."""
        return self.aspect in ("gone", "new", "moved", "changed")


def asked(text: str | None) -> Asked:
    """What a text asks about time, change or number; no aspect where it is an ordinary question."""
    spoken = " ".join((text or "").lower().replace("’", "'").split()).strip(" ?!.")
    if m := _SHORT.search(spoken):
        return Asked("new" if m[1] == "new" else "gone")
    for aspect, pattern in _PATTERNS:
        if m := re.search(pattern, spoken):
            said = next((g for g in m.groupdict().values() if g and g.strip()), "")
            thing = _thing(said or (spoken if aspect == "still" else ""))
            if thing:
                return Asked(aspect, thing, said.strip())
    if _ASKING.search(spoken) and re.search(rf"\b{_ABOUT_TIME}\b", spoken):
        for aspect, pattern in _KINDS:
            if re.search(rf"\b{pattern}\b", spoken):
                return Asked(aspect)
    return Asked()


def _thing(said: str) -> Name:
    """The first thing that a piece of a question names, without the words of asking and of time."""
    cut = re.split(
        r"\b(?:near|next to|beside|on the|in the|at the|by the|since|before|after|during|between|within|"
        r"around|that|which|who|are there|is there|can|were|was|did|do)\b",
        said,
        maxsplit=1,
    )[0]
    for part in (cut, said):
        for phrase in mentions(part.strip(" ?.,")).phrases:
            name = tuple(w for w in phrase.words if w not in _NOT_THINGS)
            if name:
                return name
    left = [fold(w) for w in words(cut) if w not in _FUNCTION and fold(w) not in _NOT_THINGS]
    return tuple(left[-2:])


def asks_where(text: str) -> bool:
    """Whether a question about the past asks for a place: `where did you last see my bicycle?`"""
    spoken = words(text)
    return bool(spoken) and ("where" in spoken or spoken[0] in ("find", "take", "show", "guide", "go", "bring"))
