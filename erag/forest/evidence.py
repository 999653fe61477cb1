"""What a summariser is given of a cluster, and the summary that code composes from facts alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.geometry import pairwise
from erag.core.text import clean, sentences
from erag.core.types import Frame, IntArray
from erag.forest.facts import Fact, Facts, FactsConfig
from erag.forest.terms import fold
from erag.forest.vocabulary import Vocabulary
from erag.lm.roles import Group, Summary

CHARS_A_TOKEN = 3.6  # English prose in the vocabularies of small models; used to keep a budget, never to cut a text
NO_TEXT = "Place without description"


class EvidenceConfig(BaseModel):
    """How much of a cluster a summariser reads: `tokens` in all, the facts first, then `members` while they fit."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    facts: FactsConfig = FactsConfig()
    tokens: int = Field(default=450, ge=64, description="facts, members and names of parts together, estimated")
    counts: bool = Field(default=False, description="tell in how many views; the smallest models copy the numbers")
    signs: bool = Field(
        default=False, description="tell what signs read; the smallest models name the place after them"
    )
    members: int = Field(default=0, ge=0, description="representative members whose words are quoted")
    member_chars: int = Field(default=220, ge=40, description="characters of whole sentences quoted of a member")
    parts: int = Field(default=0, ge=0, description="names of child clusters that are told, the largest first")


def tokens(text: str) -> int:
    """An estimate of the tokens of a text."""
    return int(len(text) / CHARS_A_TOKEN) + 1


def fact_lines(facts: Facts, parts: Sequence[str] = (), counts: bool = False, signs: bool = True) -> tuple[str, ...]:
    """The facts as labelled lists, best first, with `counts` of views on request; `parts` are names of children."""

    def listed(chosen: Sequence[Fact], mark: str = "{}", between: str = ", ") -> str:
        return between.join(mark.format(f.entry.shown) + (f" {f.views}" if counts else "") for f in chosen)

    often = f"often (of {facts.of} {facts.noun})" if counts else "often"
    lists = (
        (often, listed(facts.common)),
        ("special", listed(facts.distinctive)),
        ("looks", listed((*facts.attributes, *facts.seasons))),
        ("how", listed(facts.relations, between="; ")),
        ("parts", "; ".join(parts)),
        ("signs", listed(facts.signs if signs else (), "'{}'", "; ")),
    )
    return tuple(f"{label}: {content}" for label, content in lists if content)


def group(
    words: Vocabulary, texts: Sequence[str], rows: IntArray, facts: Facts, config: EvidenceConfig, parts: Sequence[str]
) -> Group:
    """The evidence of the cluster of base nodes `rows` (r,), within the budget: facts, then representative members."""
    left = config.tokens
    lines = []
    for line in fact_lines(facts, parts[: config.parts], config.counts, config.signs):
        if tokens(line) <= left:
            lines.append(line)
            left -= tokens(line)
    members = []
    for row in representatives(words, texts, rows, facts, config.members):
        excerpt = _excerpt(texts[row], facts, config.member_chars)
        if excerpt and tokens(excerpt) <= left and excerpt not in members:
            members.append(excerpt)
            left -= tokens(excerpt)
    return Group(tuple(members), tuple(lines))


def members_only(texts: Sequence[str], config: EvidenceConfig) -> Group:
    """The texts of the members as they are, the first that fit into the budget."""
    left, told = config.tokens, []
    for text in texts:
        excerpt = text if len(text) <= config.member_chars else text[: config.member_chars].rpartition(" ")[0]
        if excerpt and tokens(excerpt) <= left:
            told.append(excerpt)
            left -= tokens(excerpt)
    return Group(tuple(told))


def representatives(words: Vocabulary, texts: Sequence[str], rows: IntArray, facts: Facts, count: int) -> list[int]:
    """At most `count` of the base nodes `rows`: each the one that shows most of what is common and not yet shown.

    Greedy coverage of the facts weighted by their share; ties go to the shorter text, then to the first row.
    """
    wanted = [fact for fact in facts if fact.entry.kind != "sign"]
    if not count or not wanted:
        return []
    shown = words.having(rows, [fact.entry for fact in wanted])
    weights = np.array([fact.share for fact in wanted])  # (facts,); shown is (r, facts)
    chosen: list[int] = []
    while len(chosen) < min(count, len(rows)) and weights.any():
        gain = shown @ weights
        best = min(range(len(rows)), key=lambda i: (-round(float(gain[i]), 9), len(texts[int(rows[i])]), i))
        if gain[best] <= 0:
            break
        chosen.append(int(rows[best]))
        weights = np.where(shown[best], 0.0, weights)
    return chosen


def _excerpt(text: str, facts: Facts, chars: int) -> str:
    """The sentences of a member that show most facts, in their order, at most `chars` characters; maybe none."""
    spoken = sentences(text)
    stems = {word for fact in facts for word in fact.entry.words}
    worth = [len({fold(w) for w in s.lower().strip(".").split()} & stems) for s in spoken]
    kept: list[int] = []
    for i in sorted(range(len(spoken)), key=lambda i: (-worth[i], i)):
        if sum(len(spoken[j]) + 1 for j in kept) + len(spoken[i]) <= chars:
            kept.append(i)
    return " ".join(spoken[i] for i in sorted(kept))


def composed(facts: Facts, parts: Sequence[str] = ()) -> Summary:
    """A summary by code alone, from facts and the names of child clusters. `relationships` may be empty."""
    if not facts.of:
        return Summary(NO_TEXT, "None of its observations has a text.")
    said = [_listed(facts), _special(facts), _looks(facts), _signs(facts)]
    if parts and not any(said):
        said.append(f"It is made of {_join(parts)}.")
    return Summary(
        composed_name(facts), " ".join(filter(None, said)), tuple(upper(f.entry.shown) for f in facts.relations)
    )


def composed_name(facts: Facts) -> str:
    """A name from facts: the season where most views have it, the most telling place, and a thing."""
    things = (*facts.distinctive, *facts.common)
    if not things:
        return upper(next((f.entry.shown for f in facts), NO_TEXT))
    place = max(things, key=lambda f: (f.entry.kind == "place", f.z * f.share**0.5, f.views))
    rest = [f for f in things if not set(f.entry.words) & set(place.entry.words)]
    thing = max(rest, key=lambda f: (f.z * f.share**0.5, f.views), default=None)
    season = [f.entry.shown for f in facts.seasons[:1] if f.share > 0.5 and f.z > 0]
    name = " ".join((*season, place.entry.shown))
    return upper(f"{name} with {thing.entry.shown}" if thing else name)


def counted(facts: Facts) -> str:
    """What most members have, what sets them apart and what signs read, in how many of them: one or two sentences."""
    return " ".join(filter(None, (_listed(facts), _special(facts), _signs(facts))))


def _listed(facts: Facts) -> str:
    if not facts.common:
        return ""
    first, *rest = facts.common
    start = f"{upper(first.entry.shown)} in {first.views} of {facts.of} {facts.noun}"
    return f"{', '.join((start, *(f'{f.entry.shown} in {f.views}' for f in rest)))}."


def _special(facts: Facts) -> str:
    listed = _join([f"{f.entry.shown} ({f.views})" for f in facts.distinctive])
    return f"More than elsewhere: {listed}." if listed else ""


def _looks(facts: Facts) -> str:
    listed = _join([f"{f.entry.shown} ({f.views})" for f in (*facts.attributes, *facts.seasons)])
    return f"Described as {listed}." if listed else ""


def _signs(facts: Facts) -> str:
    listed = _join([f'"{f.entry.shown}" ({f.views})' for f in facts.signs])
    return f"Signs read {listed}." if listed else ""


def composed_relation(
    words: Vocabulary, rows: IntArray, facts: Facts, frame: Frame, positions: np.ndarray, mean_distance: float
) -> str:
    """One relation that always holds: how the two commonest things occur together, or how far its members are apart.

    `positions` (n, 3) are those of the whole map in its frame; `mean_distance` in metres.
    """
    pair = [f for f in facts if f.entry.kind in ("place", "object")][:2]
    if len(pair) == 2:
        first, second = words.having(rows, [f.entry for f in pair]).T
        a, b = (f.entry.shown for f in pair)
        if (first & second).any():
            return f"{upper(a)} together with {b}"
        apart = pairwise(frame, positions[rows[first]], positions[rows[second]]).min(axis=1)
        return f"{upper(a)} about {float(np.median(apart)):.1f} m from {b}"
    return f"Members {mean_distance:.0f} m from each other on average"


def _join(items: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(items[:-1]), *items[-1:])))


def upper(text: str) -> str:
    """`text` with a capital first letter."""
    shown = clean(text)
    return shown[:1].upper() + shown[1:]
