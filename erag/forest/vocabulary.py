"""Everything the texts of a map mention, counted once: a sparse table of views by entries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import sparse

from erag.core.text import node_text
from erag.core.types import IntArray, TopoMap
from erag.forest import lexicon as lex
from erag.forest.terms import Mentions, Phrase, mentions, name_mentions, with_objects

EntryKind = Literal["object", "place", "attribute", "season", "sign", "relation", "modifier"]
Table = Any  # scipy.sparse.csr_array (rows, columns); scipy ships no types
MODIFIER = 0.35  # a word that ends fewer of its phrases than this describes rather than names
MANY = 40  # captions from which on an entry has to occur twice


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that can be seen in a view: `shown` is how to say it, `words` are its folded words.

    Those of a relation are its subject, how it stands and its object.

    A `modifier` is the first half of compounds, as `fire` is of `fire hydrant`; alone it says nothing.
    """

    kind: EntryKind
    shown: str
    words: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """The mentions of n nodes: `presence` (n, e) of `entries`, and `said` and `denied` (n, w) of word `stems`.

    The three are 0/1 matrices in CSR form. `spoken` (n,) says which nodes have a text, `objects` (n,) which of them
    are named things rather than views.
    """

    entries: tuple[Entry, ...]
    presence: Table
    stems: Mapping[str, int]
    said: Table
    denied: Table
    spoken: npt.NDArray[np.bool_]
    objects: npt.NDArray[np.bool_]

    @cached_property
    def views(self) -> IntArray:
        """(e,) how many nodes mention each entry."""
        return np.asarray(self.presence.sum(axis=0), np.int64).ravel()

    @cached_property
    def column(self) -> Mapping[Entry, int]:
        """The column of each entry."""
        return {entry: i for i, entry in enumerate(self.entries)}

    def having(self, rows: IntArray, entries: Sequence[Entry]) -> npt.NDArray[np.bool_]:
        """(r, k) bool: which of the nodes `rows` mention each of k entries."""
        columns = [self.column[entry] for entry in entries]
        return np.asarray(self.presence[rows][:, columns].toarray() > 0)


def map_vocabulary(topomap: TopoMap) -> Vocabulary:
    """The vocabulary of a map's nodes: captions and what a captioner saw, or names where there is no caption."""
    named = np.array([not (node.caption or "").strip() for node in topomap.nodes], np.bool_)
    texts = [node_text(node.name, node.caption) for node in topomap.nodes]
    return vocabulary(texts, named, [node.objects for node in topomap.nodes])


def vocabulary(
    texts: Sequence[str],
    named: Sequence[bool] | npt.NDArray[np.bool_] | None = None,
    objects: Sequence[Sequence[str]] | None = None,
) -> Vocabulary:
    """The vocabulary of texts (n,); `named` marks those that are an object's name rather than a caption.

    `objects` (n) are things seen beside each text. A thing that text and objects both name counts once.

    About 0.4 ms a caption of 100 words; memory grows with the number of distinct phrases.
    """
    named = np.zeros(len(texts), np.bool_) if named is None else np.asarray(named, np.bool_)
    count = _Counter()
    for text, is_name, things in zip(texts, named, objects or [()] * len(texts), strict=True):
        count.add(with_objects(name_mentions(text) if is_name else mentions(text), things))
    spoken = np.array([bool(text) for text in texts], np.bool_)
    entries, presence = count.entries(minimum=2 if (spoken & ~named).sum() >= MANY else 1)
    said, denied = count.words.tables()
    return Vocabulary(entries, presence, count.words.columns, said, denied, spoken, named & spoken)


Key = tuple[Literal["term", "sign", "relation"], tuple[str, ...]]


@dataclass
class _Rows:
    """Column numbers, row by row."""

    flat: list[int] = field(default_factory=list)
    ends: list[int] = field(default_factory=lambda: [0])

    def add(self, columns: Sequence[int]) -> None:
        self.flat.extend(columns)
        self.ends.append(len(self.flat))

    def table(self, columns: int) -> Table:
        ones = np.ones(len(self.flat), np.int32)
        parts = (ones, np.array(self.flat, np.int64), np.array(self.ends, np.int64))
        return sparse.csr_array(parts, shape=(len(self.ends) - 1, columns))


@dataclass
class _Words:
    """Stems said and denied."""

    columns: dict[str, int] = field(default_factory=dict)
    said: _Rows = field(default_factory=_Rows)
    denied: _Rows = field(default_factory=_Rows)

    def add(self, said: frozenset[str], denied: frozenset[str]) -> None:
        for rows, stems in ((self.said, said), (self.denied, denied)):
            rows.add([self.columns.setdefault(s, len(self.columns)) for s in sorted(stems)])

    def tables(self) -> tuple[Table, Table]:
        return self.said.table(len(self.columns)), self.denied.table(len(self.columns))


class _Counter:
    """Collects mentions text by text."""

    def __init__(self) -> None:
        self.words = _Words()
        self._rows = _Rows()
        self._columns: dict[Key, int] = {}
        self._plurals: Counter[int] = Counter()  # by column: how often its head was a plural
        self._plural_forms: dict[str, Counter[str]] = {}
        self._signs: dict[int, str] = {}  # by column: a sign as first seen
        self._inside: Counter[str] = Counter()  # by word: how often it stood in a phrase
        self._heads: Counter[str] = Counter()  # by word: how often it ended one

    def add(self, said: Mentions) -> None:
        self.words.add(said.words, said.denied_words)
        columns: dict[int, None] = {}
        for phrase in said.phrases:
            self._phrase(phrase, columns)
        for sign in said.signs:
            column = self._column(("sign", tuple(sign.casefold().split())))
            self._signs.setdefault(column, sign)
            columns[column] = None
        for relation in said.relations:
            columns[self._column(("relation", relation))] = None
        self._rows.add(list(columns))

    def _phrase(self, phrase: Phrase, columns: dict[int, None]) -> None:
        self._inside.update(phrase.words)
        self._heads[phrase.words[-1]] += 1
        if phrase.plural:
            self._plural_forms.setdefault(phrase.words[-1], Counter())[phrase.plural] += 1
        for words in _parts(phrase.words):
            column = self._column(("term", words))
            if column not in columns and phrase.plural and words[-1] == phrase.words[-1]:
                self._plurals[column] += 1
            columns[column] = None

    def _column(self, key: Key) -> int:
        return self._columns.setdefault(key, len(self._columns))

    def entries(self, minimum: int) -> tuple[tuple[Entry, ...], Table]:
        """Entries in at least `minimum` texts, in alphabetical order, and their presence (n, e)."""
        table = self._rows.table(len(self._columns))
        views = np.bincount(table.indices, minlength=len(self._columns))
        kept = sorted((k, c) for k, c in self._columns.items() if self._useful(k, int(views[c]), minimum))
        entries = tuple(self._entry(key, column, int(views[column])) for key, column in kept)
        columns = np.array([column for _, column in kept], np.int64)
        return entries, sparse.csr_array(table.tocsc()[:, columns].tocsr())

    def _useful(self, key: Key, views: int, minimum: int) -> bool:
        kind, words = key
        if kind == "sign":
            return True
        if kind == "relation":
            return self._names(words[0]) and self._names(words[2])
        alone_light = len(words) == 1 and words[0] in lex.LIGHT
        return views >= minimum and not alone_light and (len(words) == 1 or self._names(words[-1]))

    def _names(self, spoken: str) -> bool:
        """Whether a word names a thing, that is ends most of its phrases, rather than describes one."""
        word = spoken.split()[-1]
        if word in lex.PLACES or word in lex.LIGHT:
            return True
        return word not in lex.ATTRIBUTES and self._heads[word] >= MODIFIER * self._inside[word]

    def _entry(self, key: Key, column: int, views: int) -> Entry:
        kind, words = key
        if kind == "sign":
            return Entry("sign", self._signs[column], words)
        if kind == "relation":
            return Entry("relation", self._relation(words), words)
        plural = 2 * self._plurals[column] > views
        shown = " ".join((*words[:-1], self._plural(words[-1]) if plural else words[-1]))
        return Entry(self._kind(words), shown, words)

    def _plural(self, word: str) -> str:
        forms = self._plural_forms.get(word)
        return min(forms, key=lambda form: (-forms[form], form)) if forms else word

    def _relation(self, relation: tuple[str, ...]) -> str:
        return " ".join((self._usual(relation[0]), relation[1], self._usual(relation[2])))

    def _usual(self, head: str) -> str:
        """A head in the number it is mostly met in."""
        column = self._columns.get(("term", tuple(head.split())))
        *rest, word = head.split()
        if column is None or not self._plural_forms.get(word):
            return head
        often = sum(self._plural_forms[word].values())
        return " ".join((*rest, self._plural(word))) if 2 * often > self._heads[word] else head

    def _kind(self, words: tuple[str, ...]) -> EntryKind:
        head = words[-1]
        if len(words) == 1 and head in lex.SEASONS:
            return "season"
        if head in lex.PLACES:
            return "place"
        if head in lex.ATTRIBUTES or head in lex.WEATHER:
            return "attribute"
        if self._names(head):
            return "object"
        return "attribute" if head.endswith(lex.ADJECTIVE_ENDINGS) else "modifier"


def _parts(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The words of a phrase, its neighbouring pairs, and its last three words."""
    parts: list[tuple[str, ...]] = [(w,) for w in words]
    parts += [words[i : i + 2] for i in range(len(words) - 1)]
    return [*parts, words[-3:]] if len(words) > 2 else parts
