"""What a place is like as a whole, told by code: its kind, its parts, what is seen most, season and weather."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from erag.aware.conditions import conditions, told
from erag.aware.things import SURROUNDINGS, Name, Things
from erag.aware.visits import Visit, ordinal
from erag.core.text import word_set, words
from erag.core.types import IntArray
from erag.forest.facts import cluster_facts
from erag.forest.vocabulary import Entry, Vocabulary

Topic = Literal["kind", "things", "parts", "conditions"]
_TOPICS: tuple[tuple[Topic, frozenset[str]], ...] = (
    ("conditions", word_set("season seasons weather daytime light conditions")),
    ("parts", word_set("parts areas divided regions zones districts sections consist rooms quarters")),
    ("things", word_set("objects things contains equipment stands items often commonly")),
    ("kind", word_set("kind sort type environment place overview whole overall summary")),
)
_GENERAL = frozenset({"what is there to see", "what can be seen", "what is here", "what do you see", "what is there"})
_LIKE = frozenset(
    {"like", "atmosphere", "mood", "trend", "vegetation", "condition", "state"}
)  # asks how something is, not what there is
THINGS, PARTS_TOLD = 7, 8
_MAIN = 0.35  # share of a part's views from which on a place names it
_ALONE, _ALL = 0.5, 0.7  # share from which on a thing may name a part; and from which on something names the whole
_EVERYWHERE = 0.98  # share above which what is named is the place itself, such as a farm
_ROOMS = ("room", "yard", "ward", "pasture", "field")
Part = tuple[str, IntArray]


def topics(text: str) -> tuple[Topic, ...]:
    """What a question about the whole asks to be told; nothing for one about something in particular."""
    spoken = words(text)
    if _LIKE & set(spoken):
        return ()
    found = [topic for topic, marks in _TOPICS if marks & set(spoken)]
    if any(general in " ".join(spoken) for general in _GENERAL):
        found.append("things")
    if "conditions" in found:
        return ("conditions",)
    if "parts" in found:
        return ("parts",)
    return ("things",) if found[:1] == ["things"] else ("kind", "things") if found else ()


class Overview:
    """Tells of any set of nodes in numbers of views."""

    def __init__(self, words_: Vocabulary, texts: Sequence[str], things: Things, visits: Sequence[Visit]) -> None:
        self._words, self._texts, self._things, self._visits = words_, texts, things, tuple(visits)

    def told(self, text: str, rows: IntArray, parts: Sequence[Part]) -> str:
        """Sentences on the topics that a question asks of the nodes `rows` (r,); empty for other questions."""
        tell = {"kind": self._kind, "things": self._seen, "conditions": self._conditions}
        said = [self._parts(parts, len(rows)) if t == "parts" else tell[t](rows) for t in topics(text)]
        return " ".join(filter(None, said))

    def name(self, rows: IntArray) -> str:
        """What a part of a map is called: a place that most of its views name, and other parts do less, else a thing.

        Empty where there is neither, or where the whole map is called that.
        """
        facts = cluster_facts(self._words, rows)
        named = [
            f for f in (*facts.distinctive, *facts.common) if f.share >= _MAIN and f.z > 0 and not self._whole(f.entry)
        ]
        places = [f for f in named if f.entry.kind == "place"]
        things = [
            f for f in named if f.entry.kind == "object" and f.share >= _ALONE and f.entry.words[-1] not in SURROUNDINGS
        ]
        best = max(places or things, key=lambda f: (f.z * f.share, len(f.entry.words)), default=None)
        return best.entry.shown if best is not None else ""

    def _whole(self, entry: Entry) -> bool:
        spoken = int(self._words.spoken.sum())
        return int(self._words.views[self._words.column[entry]]) >= _ALL * spoken

    def _kind(self, rows: IntArray) -> str:
        """The place that most views name, with the most words."""
        views = np.asarray(self._words.presence[rows].sum(axis=0), np.int64).ravel()
        met = [(self._words.entries[i], int(views[i])) for i in np.flatnonzero(views >= _MAIN * len(rows))]
        found = [f for f in met if f[0].kind == "place"] or [
            f for f in met if f[0].kind == "object" and f[1] > _EVERYWHERE * len(rows)
        ]
        if not found:
            return ""
        most = max(n for _, n in found)
        entry, n = max((f for f in found if f[1] >= 0.8 * most), key=lambda f: (len(f[0].words), f[1], f[0].shown))
        article = "an" if entry.shown[:1] in "aeiou" else "a"
        return f"This is {article} {entry.shown} ({n:,} of {len(rows):,} views say so)."

    def _seen(self, rows: IntArray) -> str:
        """What is named in most views; views are not things."""
        inside = set(rows.tolist())
        met = {name: sum(m.row in inside for m in found) for name, found in self._things.by_name.items()}
        most = sorted(
            (item for item in met.items() if item[1] and not self._place(*item, len(rows))),
            key=lambda item: (-item[1], item[0]),
        )
        distinct = [(n, c) for i, (n, c) in enumerate(most) if not any(n[-1] == o[-1] for o, _ in most[:i])][:THINGS]
        if not distinct:
            return ""
        first, *rest = [
            f"{self._things.shown(n, many=True)} ({c:,}{f' of {len(rows):,} views' * (not i)})"
            for i, (n, c) in enumerate(distinct)
        ]
        return f"Most often one sees {', '.join((first, *rest))}."

    @staticmethod
    def _place(name: Name, views: int, of: int) -> bool:
        """Whether what is named is where one is rather than a thing there."""
        return views > _EVERYWHERE * of or name[-1].endswith(_ROOMS)

    def _parts(self, parts: Sequence[Part], of: int) -> str:
        """The named parts by their share of the views; parts of one name are one."""
        views: dict[str, int] = {}
        for name, rows in parts:
            views[name] = views.get(name, 0) + len(rows)
        main = sorted(views.items(), key=lambda part: (-part[1], part[0]))[:PARTS_TOLD]
        if len(main) < 2:
            return ""
        listed = ", ".join(f"the {name} ({n:,}{f' of {of:,} views' * (not i)})" for i, (name, n) in enumerate(main))
        return f"It has about {len(main)} main parts: {listed}."

    def _conditions(self, rows: IntArray) -> str:
        """Season, weather and hour, visit by visit."""
        seen = [(v, v.rows[np.isin(v.rows, rows)]) for v in self._visits]
        spoken = [(v, told(conditions(self._texts, part))) for v, part in seen if len(part)]
        if len(spoken) < 2:
            said = told(conditions(self._texts, rows))
            return f"Views tell of {said}." if said else ""
        return " ".join(f"On {ordinal(self._visits, v.number)} views tell of {said}." for v, said in spoken if said)
