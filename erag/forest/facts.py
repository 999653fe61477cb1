"""What is common and what is distinctive among the members of a cluster, counted by code over all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from erag.core.types import IntArray
from erag.forest.vocabulary import Entry, EntryKind, Vocabulary

Floats = npt.NDArray[np.float64]
KINDS: tuple[EntryKind, ...] = ("place", "object", "attribute", "season", "sign", "relation", "modifier")


class FactsConfig(BaseModel):
    """How many facts of a cluster are told, and from when on something is common or distinctive."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    common: int = Field(default=4, ge=1, description="things and places most members have")
    distinctive: int = Field(default=4, ge=0, description="things and places the rest of the map has less of")
    attributes: int = Field(default=2, ge=0)
    seasons: int = Field(default=1, ge=0)
    signs: int = Field(default=3, ge=0)
    relations: int = Field(default=3, ge=0)
    common_share: float = Field(
        default=0.25, gt=0, le=1, description="share of members from which on a thing is common"
    )
    distinctive_share: float = Field(default=0.12, gt=0, le=1, description="and from which on it can be distinctive")
    z: float = Field(default=1.64, ge=0, description="standard errors of the log-odds from which on it is distinctive")
    prior: float = Field(default=10.0, gt=0, description="strength of the map's own rates, in views")


@dataclass(frozen=True, slots=True)
class Fact:
    """`views` of `of` members with a text mention `entry`. `z`: how much more than the rest of the map, in errors."""

    entry: Entry
    views: int
    of: int
    z: float

    @property
    def share(self) -> float:
        return self.views / self.of


@dataclass(frozen=True)
class Facts:
    """The facts of one cluster, each list best first. `of` members have a text, `objects` of them are named things."""

    of: int
    objects: int = 0
    common: tuple[Fact, ...] = ()
    distinctive: tuple[Fact, ...] = ()
    attributes: tuple[Fact, ...] = ()
    seasons: tuple[Fact, ...] = ()
    signs: tuple[Fact, ...] = ()
    relations: tuple[Fact, ...] = ()

    def __iter__(self) -> Iterator[Fact]:
        """All facts, in the order in which they are told."""
        lists = (self.common, self.distinctive, self.attributes, self.seasons, self.signs, self.relations)
        return (fact for facts in lists for fact in facts)

    @property
    def noun(self) -> str:
        """What its members are called."""
        return "objects" if self.objects == self.of else ("views" if not self.objects else "observations")


def cluster_facts(vocabulary: Vocabulary, rows: IntArray, config: FactsConfig | None = None) -> Facts:
    """The facts of the cluster whose base nodes are `rows` (r,) of the map."""
    config = config or FactsConfig()
    rows = rows[vocabulary.spoken[rows]]
    if not len(rows):
        return Facts(of=0)
    views = np.asarray(vocabulary.presence[rows].sum(axis=0), np.int64).ravel()  # (e,)
    met = np.flatnonzero(views)
    z = log_odds(views[met], len(rows), vocabulary.views[met], int(vocabulary.spoken.sum()), config.prior)
    pairs = zip(met, z, strict=True)
    facts = [Fact(vocabulary.entries[i], int(views[i]), len(rows), round(float(s), 3)) for i, s in pairs]
    return _told(facts, len(rows), int(vocabulary.objects[rows].sum()), config)


def log_odds(views: IntArray, of: int, total: IntArray, all_of: int, prior: float) -> Floats:
    """How distinctive counts are (e,): log-odds ratio to the rest of the map in standard errors.

    `views` of `of` members against `total - views` of the others, both smoothed by `prior` views at the map's own rate
    (Monroe, Colaresi and Quinn 2008, "Fightin' Words", for counts of views instead of words). 0 where there is no rest.
    """
    if of >= all_of:
        return np.zeros(len(views))
    seen = prior * (total + 0.5) / (all_of + 1)  # never 0, never all
    unseen = prior - seen
    inside = np.log((views + seen) / (of - views + unseen))
    outside = np.log((total - views + seen) / (all_of - of - total + views + unseen))
    variance = 1 / (views + seen) + 1 / (of - views + unseen)
    variance = variance + 1 / (total - views + seen) + 1 / (all_of - of - total + views + unseen)
    return np.asarray((inside - outside) / np.sqrt(variance), np.float64)


def _told(facts: Sequence[Fact], of: int, objects: int, config: FactsConfig) -> Facts:
    by_kind: dict[str, list[Fact]] = {kind: [] for kind in KINDS}
    for fact in facts:
        by_kind[fact.entry.kind].append(fact)
    things = _longer(by_kind["place"] + by_kind["object"])
    least = max(1, config.distinctive_share * of, 2 if of > 3 else 1)
    if objects == of:  # an inventory: names are short and each member has only one
        return Facts(of, objects, tuple(_best(things, _telling, config.common + config.distinctive)))
    common = _best((f for f in things if f.share >= config.common_share), _telling, config.common)
    special = (f for f in things if f.z >= config.z and f.views >= least)
    distinctive = _best(special, lambda f: f.z * f.share**0.35, config.distinctive, common)
    qualities = (f for f in by_kind["attribute"] if f.share >= config.common_share and f.z >= 0)
    twice = 2 if of > 3 else 1
    return Facts(
        of,
        objects,
        tuple(common),
        tuple(distinctive),
        tuple(_best(qualities, lambda f: f.z + 3 * f.share, config.attributes, [*common, *distinctive])),
        tuple(sorted(by_kind["season"], key=_most)[: config.seasons]),
        tuple(sorted((f for f in by_kind["sign"] if f.views >= twice), key=_most)[: config.signs]),
        tuple(_best((f for f in by_kind["relation"] if f.views >= twice), _telling, config.relations)),
    )


def _longer(facts: Sequence[Fact]) -> list[Fact]:
    """Without single words that are nearly always part of one phrase: `hydrant` where it is `fire hydrant`."""
    usual: dict[str, int] = {}
    for fact in facts:
        if len(fact.entry.words) > 1:
            usual.update({w: max(usual.get(w, 0), fact.views) for w in fact.entry.words})
    alone = (f for f in facts if len(f.entry.words) == 1)
    swallowed = {f.entry.words[0] for f in alone if usual.get(f.entry.words[0], 0) >= 0.7 * f.views}
    return [f for f in facts if f.entry.words[0] not in swallowed or len(f.entry.words) > 1]


def _telling(fact: Fact) -> float:
    """How much a common fact says: its count, and more where it has more words or is more usual here than elsewhere."""
    return fact.views * (1 + 0.2 * (len(fact.entry.words) - 1)) * (1.25 if fact.z > 1 else 1.0)


def _most(fact: Fact) -> tuple[int, float, str]:
    return (-fact.views, -fact.z, fact.entry.shown)


def _best(facts: Any, value: Any, limit: int, told: Sequence[Fact] = ()) -> list[Fact]:
    """The `limit` facts of highest value that say something besides those told; ties by text."""
    chosen: list[Fact] = []
    for fact in sorted(facts, key=lambda f: (-value(f), f.entry.shown)):
        if len(chosen) == limit:
            break
        if not any(_repeats(fact, other) for other in (*told, *chosen)):
            chosen.append(fact)
    return chosen


def _repeats(fact: Fact, other: Fact) -> bool:
    """Whether `fact` is contained in one already told, or says much the same of nearly as many views."""
    mine, theirs = set(fact.entry.words), set(other.entry.words)
    if fact.entry.kind == "relation":
        return other.entry.kind == "relation" and (
            fact.entry.words[0] == other.entry.words[0] or len(mine & theirs) > 1
        )
    return mine <= theirs or (len(mine & theirs) >= len(mine | theirs) / 2 and fact.views >= 0.4 * other.views)
