"""Name, summary and relationships of every cluster: evidence by code, words by a summariser, checked by members."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import BadModelOutput
from erag.core.progress import Progress, quiet
from erag.core.text import clean, node_text
from erag.core.types import Cluster, Forest, IntArray, TopoMap
from erag.forest import lexicon as lex
from erag.forest.evidence import (
    EvidenceConfig,
    composed,
    composed_relation,
    counted,
    group,
    members_only,
    upper,
)
from erag.forest.facts import Facts, cluster_facts
from erag.forest.support import Evidence, Shares, check
from erag.forest.terms import mentions, statements
from erag.forest.vocabulary import map_vocabulary
from erag.lm.ledger import Ledger
from erag.lm.roles import Group, Summary

STAGE = "summaries"
_ALSO = re.compile(r"^(It) also (?=has|contains|shows)")
_STUTTER = re.compile(r"\b(\w+)(?: \1\b)+", re.IGNORECASE)


class SummaryConfig(BaseModel):
    """What a summariser is given, and what is kept of what it says.

    `source`: `facts` are counted by code over all base nodes; `members` are the texts of the members themselves,
    captions or summaries of the level below, as in the paper. `again` is what it is given once more where a part of its
    answer is missing or was taken out. `check` takes out what no member supports. `counts` adds what most members have,
    counted by code, after the summariser's own words. `keep` leaves clusters that have a summary, such as those of a
    given forest, as they are.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    source: Literal["facts", "members"] = "facts"
    check: bool = True
    evidence: EvidenceConfig = EvidenceConfig()
    again: EvidenceConfig | None = EvidenceConfig(members=1)
    counts: bool = True
    keep: bool = True
    name_chars: int = Field(default=60, ge=8)
    text_chars: int = Field(default=600, ge=40, description="of the summariser's own words")
    relationships: int = Field(default=6, ge=1)
    relationship_chars: int = Field(default=100, ge=8)
    text_share: float = Field(default=0.03, ge=0, le=1, description="of members that bear out what is said of them all")
    name_share: float = Field(default=0.1, ge=0, le=1, description="of members that bear out the name")


class Speaker(Protocol):
    """The part of an `LMBackend` that is used here."""

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        """One summary a group, same order."""
        ...


def summarise_forest(
    topomap: TopoMap,
    forest: Forest,
    speaker: Speaker,
    config: SummaryConfig | None = None,
    ledger: Ledger | None = None,
    progress: Progress = quiet,
) -> Forest:
    """`forest` with a name, a summary and relationships on every cluster, the root included (paper, semantic forest).

    Levels go bottom-up, each in one call of `speaker`: behind a journal, what was asked before is not asked again.
    Whatever the summariser answers badly or without support is composed from the facts, and counted in `ledger`.
    """
    summaries = Summaries(topomap, speaker, config, ledger)
    done: dict[str, Cluster] = {}
    for level in sorted({c.level for c in forest.clusters}):
        progress(STAGE, len(done), len(forest.clusters))
        done.update({c.id: c for c in summaries.level([c for c in forest.clusters if c.level == level])})
    progress(STAGE, len(done), len(forest.clusters))
    return dataclasses.replace(forest, clusters=tuple(done[c.id] for c in forest.clusters))


@dataclasses.dataclass(frozen=True)
class _Asked:
    """A cluster and what is known of it: its base nodes (r,), its facts, the names of its child clusters."""

    cluster: Cluster
    rows: IntArray
    facts: Facts
    parts: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Accepted:
    """What a summariser is asked about a cluster, what is left of its answers, and what would be of another one."""

    group: Group
    summary: Summary
    left: Callable[[Summary], Summary]


class Summaries:
    """Summarises clusters level by level; a level may be asked for while the next is not built yet."""

    def __init__(
        self, topomap: TopoMap, speaker: Speaker, config: SummaryConfig | None = None, ledger: Ledger | None = None
    ) -> None:
        self._topomap, self._speaker = topomap, speaker
        self._config, self._ledger = config or SummaryConfig(), ledger or Ledger()
        self._texts = [node_text(node.name, node.caption) for node in topomap.nodes]
        self._words = map_vocabulary(topomap)
        self._rows = {node.id: np.array([i], np.int64) for i, node in enumerate(topomap.nodes)}
        self._names: dict[str, str] = {}
        self._said = {node.id: text for node, text in zip(topomap.nodes, self._texts, strict=True)}

    def level(self, clusters: Sequence[Cluster]) -> list[Cluster]:
        """`clusters` with their texts; members are nodes of the map or clusters of earlier calls."""
        asked = [self._asked(cluster) for cluster in clusters]
        spoken = [a for a in asked if a.facts.of and not self._kept(a.cluster)]
        said = dict(zip([a.cluster.id for a in spoken], self._say(spoken), strict=True))
        done = [a.cluster if self._kept(a.cluster) else self._finished(a, said.get(a.cluster.id)) for a in asked]
        self._remember(done)
        return done

    def accepted(self, clusters: Sequence[Cluster]) -> list[Accepted]:
        """As `level`, of clusters that have their texts: those with facts, and parts may be missing."""
        asked = [self._asked(cluster) for cluster in clusters]
        spoken = [a for a in asked if a.facts.of]
        self._remember(clusters)
        return [
            Accepted(self._group(a, self._config.evidence), said, partial(self._kept_of, a))
            for a, said in zip(spoken, self._say(spoken), strict=True)
        ]

    def _remember(self, clusters: Sequence[Cluster]) -> None:
        self._names.update({c.id: c.name for c in clusters})
        self._said.update({c.id: f"{c.name}: {c.summary}" for c in clusters})

    def _say(self, asked: Sequence[_Asked]) -> list[Summary]:
        """What a summariser says of each cluster and its members bear out; what is missing then is asked once more."""
        evidence, again = self._config.evidence, self._config.again
        answers = self._ask([self._group(a, evidence) for a in asked])
        said = [self._kept_of(a, answer) for a, answer in zip(asked, answers, strict=True)]
        missing = [i for i, s in enumerate(said) if not (s.text and s.name and s.relationships)]
        if again is None or not missing:
            return said
        self._count("clusters asked again", len(missing))
        answers = self._ask([self._group(asked[i], again) for i in missing])
        for i, answer in zip(missing, answers, strict=True):
            said[i] = _filled(said[i], self._kept_of(asked[i], answer))
        return said

    def _group(self, asked: _Asked, evidence: EvidenceConfig) -> Group:
        if self._config.source == "members":
            return members_only([self._said[m] for m in asked.cluster.members], evidence)
        return group(self._words, self._texts, asked.rows, asked.facts, evidence, asked.parts)

    def _kept(self, cluster: Cluster) -> bool:
        return self._config.keep and bool(cluster.summary)

    def _asked(self, cluster: Cluster) -> _Asked:
        rows = np.unique(np.concatenate([self._rows[member] for member in cluster.members]))
        self._rows[cluster.id] = rows
        parts = [m for m in cluster.members if self._names.get(m)]
        largest = sorted(parts, key=lambda m: (-len(self._rows[m]), m))
        facts = cluster_facts(self._words, rows, self._config.evidence.facts)
        return _Asked(cluster, rows, facts, tuple(dict.fromkeys(self._names[m] for m in largest)))

    def _ask(self, groups: Sequence[Group]) -> list[Summary | None]:
        """A summary for each group, None where the model cannot: a batch that fails is asked again in halves."""
        if not groups:
            return []
        try:
            return list(self._speaker.summarise(groups))
        except BadModelOutput:
            if len(groups) == 1:
                return [None]
        half = len(groups) // 2
        return [*self._ask(groups[:half]), *self._ask(groups[half:])]

    def _finished(self, asked: _Asked, said: Summary | None) -> Cluster:
        """The cluster with what was said of it; what is missing is composed from its facts, and counted."""
        cluster, facts = asked.cluster, asked.facts
        spare = composed(facts, asked.parts)
        if said is None:
            self._count("clusters without any text")
            return dataclasses.replace(
                cluster, name=spare.name, summary=spare.text, relationships=(self._relation(asked),)
            )
        self._count("summaries composed from facts", not said.text)
        self._count("names composed from facts", not said.name)
        self._count("relationships composed from facts", not said.relationships)
        how = said.relationships or spare.relationships or (self._relation(asked),)
        text = said.text or spare.text
        if self._config.counts and said.text:
            text = " ".join(filter(None, (said.text, counted(facts))))
        return dataclasses.replace(cluster, name=said.name or spare.name, summary=text, relationships=how)

    def _kept_of(self, asked: _Asked, answer: Summary | None) -> Summary:
        """What is left of an answer; parts may be empty."""
        if answer is None:
            self._count("summaries refused: not of the schema")
            return Summary("", "")
        tidy = self._tidy(answer)
        if not self._config.check:
            return tidy
        shares = Shares(self._config.text_share, self._config.name_share)
        checked = check(tidy, Evidence(self._words, asked.rows, asked.facts), shares)
        self._count("statements written", checked.statements)
        self._count("unsupported statements removed", len(checked.removed))
        self._count("statements on too few members removed", len(checked.rare))
        left = checked.summary
        how = tuple(r for r in left.relationships if _relates(r))
        return Summary(left.name, _begun(left.text), how)

    def _tidy(self, answer: Summary) -> Summary:
        """Within the lengths, at whole sentences, and without what is said again and again or what are no words."""
        whole, cut = whole_sentences(_spoken(answer.text), self._config.text_chars)
        text, repeats = without_repeats(whole)
        name = _STUTTER.sub(r"\1", _spoken(answer.name)).rstrip(" .,;:")
        how = [_spoken(r).rstrip(" .,;:")[: self._config.relationship_chars] for r in answer.relationships]
        self._count("summaries truncated", cut)
        self._count("repeated phrases removed", repeats)
        distinct = tuple(dict.fromkeys(upper(r) for r in how if r))[: self._config.relationships]
        return Summary(upper(_words_within(name, self._config.name_chars)), text, distinct)

    def _relation(self, asked: _Asked) -> str:
        frame, positions = self._topomap.frame, self._topomap.positions
        return composed_relation(self._words, asked.rows, asked.facts, frame, positions, asked.cluster.mean_distance)

    def _count(self, event: str, times: int = 1) -> None:
        if times:
            self._ledger.events[event] += times


def _spoken(text: str) -> str:
    """`text` cleaned; nothing where it has no letter or digit."""
    return clean(text) if any(c.isalnum() for c in text) else ""


def _filled(said: Summary, more: Summary) -> Summary:
    return Summary(said.name or more.name, said.text or more.text, said.relationships or more.relationships)


def _begun(text: str) -> str:
    """`text` without a reference to a first sentence that was removed."""
    return _ALSO.sub(r"\1 ", text, count=1)


def _relates(relationship: str) -> bool:
    """Whether it names two things, rather than one, or a thing and a quality."""
    heads = {phrase.words[-1] for phrase in mentions(relationship).phrases} - lex.ATTRIBUTES
    return len(heads) > 1


def whole_sentences(text: str, limit: int) -> tuple[str, bool]:
    """The sentences of `text` within `limit` characters, and whether something was cut, such as a last half sentence.

    A text of one sentence without an end mark is kept, up to its last comma where it is too long.
    """
    spoken = statements(text)
    ended = text.rstrip("\"'”’»)]").endswith((".", "!", "?", "…"))
    kept = spoken if ended or len(spoken) == 1 else spoken[:-1]
    while len(kept) > 1 and len(" ".join(kept)) > limit:
        kept = kept[:-1]
    whole = " ".join(kept)
    if len(whole) > limit:
        whole = whole[:limit].rpartition(",")[0] or _words_within(whole, limit)
    shown = (
        f"{whole.rstrip(' ,;:')}." if whole and not whole.endswith((".", "!", "?", "…", '"', "'", "”", "’")) else whole
    )
    return shown, len(whole) < len(text)


def without_repeats(text: str) -> tuple[str, int]:
    """`text` without clauses (between commas) that name only what was named before, and how many were taken out."""
    seen: set[frozenset[str]] = set()
    removed, out = 0, []
    for sentence in statements(text):
        clauses = []
        for clause in sentence.rstrip(".").replace(";", ",").split(", "):
            named = mentions(clause).words
            if named and named in seen:
                removed += 1
                continue
            seen.add(named)
            clauses.append(clause)
        if clauses:
            out.append(upper(f"{', '.join(clauses).rstrip(' ,')}."))
    return (" ".join(out), removed) if removed else (text, 0)


def _words_within(text: str, limit: int) -> str:
    """The first words of `text` that fit into `limit` characters."""
    if len(text) <= limit:
        return text
    return text[: limit + 1].rpartition(" ")[0].rstrip(" ,;:") or text[:limit]
