"""Whether a summary says only what members of its cluster say, and how much of their facts it says."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray
from erag.forest import lexicon as lex
from erag.forest.facts import Fact
from erag.forest.terms import Mentions, Phrase, fold, mentions, statements, stem
from erag.forest.vocabulary import Entry, Vocabulary, vocabulary
from erag.lm.roles import Summary

_NUMBER = re.compile(r"\d+")
_METRES = re.compile(r"\d+(?:\.\d+)? m\b")
Views = npt.NDArray[np.bool_]  # (r,) which members


class Evidence:
    """What r members say, ready to be asked. `facts` lend their counts: numbers a statement may use.

    `measured` lets distances in metres pass, which code measures and no member says; a model's are never let pass.
    """

    def __init__(
        self, words: Vocabulary, rows: IntArray, facts: Iterable[Fact] = (), *, measured: bool = False
    ) -> None:
        self._words, self._rows, facts = words, rows, tuple(facts)
        self._measured = measured
        self._said = words.said[rows].tocsc()
        self._denied = words.denied[rows].tocsc()
        self._numbers = {str(n) for fact in facts for n in (fact.views, fact.of)} | {str(len(rows))}

    @property
    def members(self) -> int:
        """How many members speak."""
        return len(self._rows)

    @classmethod
    def of_texts(cls, texts: Sequence[str]) -> Evidence:
        """Evidence from the members' texts alone: a word that none of them has counts as unknown everywhere."""
        return cls(vocabulary(texts), np.arange(len(texts)))

    @cached_property
    def _signs(self) -> frozenset[str]:
        return frozenset(" ".join(e.words) for e in self._mentioned if e.kind == "sign")

    def supports(self, statement: str, least: int = 1) -> bool:
        """Whether one sentence asserts nothing that fewer than `least` members bear out.

        Each phrase needs members that have all its words (folded, or a narrower word: a car is a vehicle); a denied
        phrase needs a member that denies it; a quoted text has to be quoted by a member; a number has to stand in a
        member's text or among the facts. Words of evaluation and abstraction are not checked.
        """
        said = mentions(statement)
        return (
            all(self._has(phrase, least) for phrase in said.phrases)
            and all(self._lacks(phrase) for phrase in said.denied)
            and all(" ".join(sign.casefold().split()) in self._signs for sign in said.signs)
            and self._counts(statement, said)
        )

    def relates(self, statement: str, least: int = 1) -> bool:
        """As `supports`, and not otherwise than members say: a street bordered by a sidewalk is not on a sidewalk.

        Where members relate two things, a statement that relates them has to do so in nearly the same way as one of
        them; things that no member relates only have to occur together in one member's text.
        """
        stated = {_nearly(relation) for relation in mentions(statement).relations}
        known = {frozenset((first, second)) for first, _, second in self._relations}
        contrary = (r for r in stated - self._relations if frozenset((r[0], r[2])) in known)
        return self.supports(statement, least) and next(contrary, None) is None

    @cached_property
    def _mentioned(self) -> tuple[Entry, ...]:
        columns = np.unique(self._words.presence[self._rows].indices)
        return tuple(self._words.entries[c] for c in columns)

    @cached_property
    def _relations(self) -> frozenset[tuple[str, str, str]]:
        return frozenset(_nearly(e.words) for e in self._mentioned if e.kind == "relation")

    def _has(self, phrase: Phrase, least: int = 1) -> bool:
        views: Views = np.ones(len(self._rows), np.bool_)
        for word in phrase.words:
            if not self._neutral(word):
                views &= self._views(word)
        return int(views.sum()) >= min(least, len(self._rows))

    def _lacks(self, phrase: Phrase) -> bool:
        """A head that some member denies, or that no member mentions."""
        head = phrase.words[-1]
        column = self._words.stems.get(stem(head))
        denied = column is not None and self._denied[:, [column]].nnz > 0
        return denied or self._neutral(head) or not self._views(head).any()

    def _views(self, word: str) -> Views:
        """(r,) the members that have `word`, a narrower word, or all parts of a compound."""
        views = self._exact(word)
        for other in lex.BROADER.get(word, "").split():
            views |= self._exact(other)
        if "-" in word and not views.any():
            views = np.logical_and.reduce([self._views(fold(part)) for part in word.split("-")])
        return views

    def _exact(self, word: str) -> Views:
        views: Views = np.zeros(len(self._rows), np.bool_)
        column = self._words.stems.get(stem(word))
        if column is not None:
            start, end = self._said.indptr[column : column + 2]
            views[self._said.indices[start:end]] = True
        return views

    def _neutral(self, word: str) -> bool:
        """Whether a word asserts nothing: evaluation, abstraction, or an abstract noun that the whole map lacks."""
        if word in lex.NEUTRAL or word in lex.LIGHT or (word == "sign" and self._signs):
            return True
        return word.endswith(lex.ABSTRACT_ENDINGS) and stem(word) not in self._words.stems

    def _counts(self, statement: str, said: Mentions) -> bool:
        if self._measured:
            statement = _METRES.sub(" ", statement)
        quoted = {n for sign in said.signs for n in _NUMBER.findall(sign)}
        numbers = set(_NUMBER.findall(statement)) - quoted - self._numbers
        return all(self._exact(n).any() for n in numbers)


def _nearly(relation: Sequence[str]) -> tuple[str, str, str]:
    first, how, second = relation
    return (first, lex.NEARLY.get(how, how), second)


@dataclass(frozen=True, slots=True)
class Checked:
    """What is left of a summary of `statements` names, sentences and relationships.

    `removed` were borne out by no member, `rare` by too few for what is said of the whole cluster.
    """

    summary: Summary
    removed: tuple[str, ...]
    rare: tuple[str, ...]
    statements: int


@dataclass(frozen=True, slots=True)
class Shares:
    """From which share of its members on something may be said of a cluster and may name it; one member at least."""

    text: float = 0.0
    name: float = 0.0


def supported(text: str, evidence: Evidence) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The sentences of `text` that are kept, and those that no member supports."""
    spoken = statements(text)
    good = [evidence.supports(sentence) for sentence in spoken]
    kept = tuple(s for s, ok in zip(spoken, good, strict=True) if ok)
    return kept, tuple(s for s, ok in zip(spoken, good, strict=True) if not ok)


def check(summary: Summary, evidence: Evidence, shares: Shares = Shares()) -> Checked:
    """`summary` without the sentences, relationships and the name that its members do not support."""
    least, least_name = (max(1, math.ceil(share * evidence.members)) for share in (shares.text, shares.name))
    kept, removed = supported(summary.text, evidence)
    told = tuple(s for s in kept if evidence.supports(s, least))
    related = [r for r in summary.relationships if evidence.relates(r)]
    how = tuple(r for r in related if evidence.relates(r, least))
    named = not summary.name or evidence.supports(summary.name)
    name = summary.name if named and evidence.supports(summary.name, least_name) else ""
    bad = (*removed, *(r for r in summary.relationships if r not in related), *(() if named else (summary.name,)))
    few = (*(s for s in kept if s not in told), *(r for r in related if r not in how))
    rare = (*few, summary.name) if named and summary.name and not name else few
    said = len(kept) + len(removed) + len(summary.relationships) + bool(summary.name)
    return Checked(Summary(name, " ".join(told), how), bad, rare, said)


def coverage(summary: Summary, facts: Iterable[Fact]) -> float:
    """Member-fact coverage: the share of `facts` that name, text or relationships mention; 1 where there are none.

    A fact is mentioned when all words of its entry are, or broader ones; a relation when both its things are, a sign
    when it is quoted or spelt out.
    """
    text = ". ".join((summary.name, summary.text, *summary.relationships))
    spoken = mentions(text).words | {stem(fold(w)) for w in re.findall(r"[^\W_]+", text)}
    wanted = list(facts)
    if not wanted:
        return 1.0
    return sum(_mentioned(fact, spoken, text) for fact in wanted) / len(wanted)


def _mentioned(fact: Fact, spoken: frozenset[str], text: str) -> bool:
    if fact.entry.kind == "sign":
        return fact.entry.shown.casefold() in text.casefold()
    words = fact.entry.words
    if fact.entry.kind == "relation":
        words = (*words[0].split(), *words[2].split())
    return all(stem(word) in spoken or _broader(word) & spoken for word in words if word not in lex.LIGHT)


def _broader(word: str) -> set[str]:
    return {stem(general) for general, narrow in lex.BROADER.items() if word in narrow.split()}
