"""Answers about time, change and number: which thing was seen when, what changed, how many there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.aware.asked import Asked, asks_where
from erag.aware.changes import Change, ChangeKind, Changes
from erag.aware.conditions import differing
from erag.aware.past import Past, Sighting
from erag.aware.reading import Read
from erag.aware.readings import readings, trend_words
from erag.aware.things import Mention, Name
from erag.aware.visits import Visit, ordinal
from erag.core.text import sentences, words
from erag.core.times import plain_moment, plain_span
from erag.core.types import Hit, IntArray, QueryKind
from erag.forest.terms import fold, mentions
from erag.retrieve.corpus import Corpus

TOLD = 12  # things of one kind that are named in an answer
FEW = 3  # fewer changes than this are told beside views of both visits
SHOWN = 5  # views an answer names as evidence
_NEARLY = 0.9  # of the best score: what else may be meant
_CONDITIONS = frozenset({"season", "seasons", "weather", "light", "conditions", "daytime"})
_ALIKE = "Season, weather and light are told of both visits alike."
Eligible = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Recalled:
    """What an answer says, the rows it rests on, the best first, and whether the first of them is where to go.

    Views of the visits `beside` are to be quoted as well, since the text alone says little of them.
    """

    kind: QueryKind
    text: str
    reason: str = ""
    rows: tuple[int, ...] = ()
    beside: tuple[Visit, ...] = ()


class Memories:
    """Answers from the past of a corpus."""

    def __init__(self, corpus: Corpus, past: Past) -> None:
        self._corpus, self._past = corpus, past

    def recall(self, text: str, read: Read, eligible: Eligible) -> Recalled | None:
        """The answer to a question about time, change or number; None for others and for things nobody named."""
        asked = read.asked
        if asked.changes:
            return self._changes(text, asked, read)
        if asked.aspect is None or not asked.thing:
            return None
        if asked.aspect == "count":
            return self._count(asked.thing, eligible)
        return self._sighted(text, asked, read, eligible)

    # When and where a thing was seen

    def _sighted(self, text: str, asked: Asked, read: Read, eligible: Eligible) -> Recalled | None:
        named = self._of_place(self._past.mentions(asked.thing, eligible), asked)
        found = self._past.first(named) if asked.aspect == "first" else self._past.last(named)
        if found is None:
            return None
        order = sorted(named, key=lambda m: (m.row != found.row, -float(np.nan_to_num(self._past.times[m.row]))))
        said = self._still(asked.thing, found) if asked.aspect == "still" else self._when(asked, found, read.now)
        reason = f'{self._id(found.row)} says: "{self._quote(found.row, asked.thing)}"'
        where = asks_where(text) and asked.aspect in ("last", "first")
        return Recalled("find" if where else "explain", said, reason, tuple(m.row for m in order))

    def _of_place(self, named: Sequence[Mention], asked: Asked) -> tuple[Mention, ...]:
        """Of mentions those whose texts have the other things the question names too, where there are such."""
        others = {p.words[-1] for p in mentions(asked.text).phrases} - set(asked.thing)
        both = (m for m in named if others and others <= {fold(w) for w in self._corpus.texts[m.row].lower().split()})
        return tuple(both) or tuple(named)

    def _when(self, asked: Asked, found: Sighting, now: float | None) -> str:
        order = "first" if asked.aspect == "first" else "last"
        when = f"on {plain_moment(found.seconds)} UTC at {self._id(found.row)}"
        said = f"{self._a(asked.thing, capital=True)} was {order} seen {when}"
        if now is not None and now > found.seconds:
            said += f", {plain_span(now - found.seconds)} ago"
        elif now == found.seconds:
            said += ", with the newest observation of this memory"
        return f"{said}{self._since(found)}."

    def _since(self, found: Sighting) -> str:
        n = len(found.missed)
        if not n:
            return ""
        return f"; {n} later view{'s' * (n > 1)} of that spot {'do' if n > 1 else 'does'} not mention it"

    def _still(self, name: Name, found: Sighting) -> str:
        latest = self._past.visits[-1] if self._past.visits else None
        when = f"{plain_moment(found.seconds)} UTC at {self._id(found.row)}"
        if latest is None or found.seconds >= latest.start:
            return f"Yes: the {' '.join(name)} was there on the latest visit, last seen on {when}."
        if found.missed:
            sure = "Probably not" if len(found.missed) > 1 else "Perhaps not"
            return f"{sure}: the {' '.join(name)} was last seen on {when}{self._since(found)}."
        return f"Unknown: the {' '.join(name)} was last seen on {when}, and nobody has looked at that spot since."

    def nearest(self, read: Read, hits: Sequence[Hit]) -> Recalled | None:
        """For a thing nobody named: the latest of the places that come nearly as near to the question as the best."""
        best = max(map(_likeness, hits), default=0.0)
        near = [h for h in hits if _likeness(h) >= _NEARLY * best]
        rows = [self._corpus.topomap.row[h.node] for h in near]
        timed = [r for r in rows if np.isfinite(self._past.times[r])]
        if read.asked.aspect not in ("last", "ago") or not timed:
            return None
        latest = max(timed, key=lambda r: (self._past.times[r], -r))
        when = f"{plain_moment(float(self._past.times[latest]))} UTC at {self._id(latest)}"
        name = " ".join(read.asked.thing)
        said = f'Nothing seen is called "{name}"; what comes nearest to it was last seen on {when}.'
        reason = f'{self._id(latest)} says: "{self._corpus.texts[latest]}"'
        return Recalled("explain", said, reason, (latest, *(r for r in rows if r != latest)))

    # What changed

    def _changes(self, text: str, asked: Asked, read: Read) -> Recalled:
        since = read.window.since if read.window.since is not None else read.query.since
        pair = self._past.compared(since, read.query.until)
        if pair is None:
            return Recalled("explain", "This memory holds a single visit: there is nothing to compare it with.")
        before, after = pair
        if _CONDITIONS & set(words(text)):
            return Recalled(
                "explain", " ".join(self._conditions(before, after)) or _ALIKE, self._between(before, after)
            )
        kinds = _ORDER[asked.aspect or "changed"]
        found = self._past.changes(before, after)
        said = [self._told(found, kind) for kind in kinds if kind == kinds[0] or found.of(kind)]
        if asked.aspect == "changed":
            said += self._conditions(before, after)
        kept = [c for kind in kinds for c in found.of(kind)]
        rows = tuple(dict.fromkeys(c.seen[-1] if c.kind == "moved" else c.seen[0] for c in kept))
        doubt = "; what was only seen from another side, or left unnamed, may be missed"
        beside = (before, after) if asked.aspect == "changed" and len(kept) < FEW else ()
        return Recalled("explain", " ".join(said), self._between(before, after) + doubt, rows[:SHOWN], beside)

    def _between(self, before: Visit, after: Visit) -> str:
        visits = self._past.visits
        between = f"from {ordinal(visits, before.number)} to {ordinal(visits, after.number)}"
        return f"compared {len(before.rows)} with {len(after.rows)} observations, {between}"

    def _told(self, found: Changes, kind: ChangeKind) -> str:
        changes = [c for c in found.changes if c.kind == kind][:TOLD]
        lead = {"gone": "Gone", "new": "New", "moved": "Moved, or one gone and another come"}[kind]
        if not changes:
            nothing = {
                "gone": "Nothing is seen to be gone",
                "new": "Nothing new is seen",
                "moved": "Nothing is seen to have moved",
            }
            return f"{nothing[kind]}."
        sure = [c for c in changes if c.probable]
        rest = [c for c in changes if not c.probable]
        parts = [f"{lead}: {self._listed(sure)}."] if sure else []
        perhaps = f"{'Perhaps also' if sure else 'Perhaps'} {lead[:1].lower()}{lead[1:]}"
        return " ".join((*parts, *([f"{perhaps}: {self._listed(rest)}."] if rest else [])))

    def _listed(self, changes: Sequence[Change]) -> str:
        return ", ".join(f"{self._a(c.name)} (seen at {self._id(c.seen[0])}{self._missed(c)})" for c in changes)

    def _missed(self, change: Change) -> str:
        n = len(change.looked)
        other = {"gone": "later", "new": "earlier"}.get(change.kind)
        return f"; not in {n} {other} view{'s' * (n != 1)} of that spot" if other and n else ""

    def _conditions(self, before: Visit, after: Visit) -> list[str]:
        """How season, weather and light of two visits differ, and the mean readings."""
        first, second = differing(self._corpus.texts, before.rows, after.rows)
        said = [f"The first time views tell of {first}, the second time of {second}."] if first and second else []
        both = np.sort(np.concatenate([before.rows, after.rows]))
        channels = sorted({c for r in both for c in self._corpus.topomap.nodes[int(r)].sensors})
        for channel in channels:
            found = readings(self._corpus.topomap, both, channel, (before.rows, after.rows))
            said += [f"The mean {channel} is {trend_words(found.trend)}."] if found and found.trend else []
        return said

    # How many there are

    def _count(self, name: Name, eligible: Eligible) -> Recalled | None:
        rows = np.flatnonzero(eligible)
        named = self._past.mentions(name, eligible)
        if not named:
            return None
        visits = [v for v in self._past.visits if eligible[v.rows].any()]
        said = self._numbers(name, rows, visits)
        reason = "counted by place: views that may show the same one count once, what was never named does not count"
        return Recalled("explain", said, reason, tuple(m.row for m in named)[:SHOWN])

    def _numbers(self, name: Name, rows: IntArray, visits: Sequence[Visit]) -> str:
        parts = [(f" on {ordinal(self._past.visits, v.number)}", v.rows[np.isin(v.rows, rows)]) for v in visits]
        if len(parts) < 2:
            parts = [("", rows)]
        told = []
        for when, part in parts:
            found = self._past.number(name, part)
            about = "" if found.exact else "about "
            what = self._past.things.shown(name, many=found.count != 1)
            views = f", named in {found.views} of {found.of} views" if found.of else ""
            told.append(f"{about}{found.count} {what}{when}{views}")
        text = "; ".join(told)
        return f"{text[:1].upper()}{text[1:]}."

    def _id(self, row: int) -> str:
        return self._corpus.topomap.nodes[row].id

    def _quote(self, row: int, name: Name) -> str:
        """The sentence of a node that names a thing."""
        spoken = sentences(self._corpus.texts[row])
        having = (s for s in spoken if set(name) <= {fold(w.strip('.,;:!?"()')) for w in s.lower().split()})
        return next(having, self._corpus.texts[row])

    def _a(self, name: Name, capital: bool = False) -> str:
        said = f"{'an' if name[0][:1] in 'aeiou' else 'a'} {' '.join(name)}"
        return f"{said[:1].upper()}{said[1:]}" if capital else said


_ORDER: dict[str, tuple[ChangeKind, ...]] = {
    "gone": ("gone", "moved"), "new": ("new", "moved"), "moved": ("moved",), "changed": ("gone", "new", "moved"),
}  # fmt: skip


def _likeness(hit: Hit) -> float:
    """How near a hit comes to the question, wherever it is; its score where it has no other."""
    return hit.score if hit.semantic is None else hit.semantic
