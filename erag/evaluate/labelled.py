"""Labelled queries asked of a memory: precision by kind of query, with intervals."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from erag.core.errors import InputError
from erag.data.contract import QueryLine, Result, read_queries
from erag.evaluate.metrics import Interval, bootstrap, precision_at
from erag.pipeline.query import Asker

PARTS = ("at", "sensor", "since", "until")  # the conditions a query may have beside its text


@dataclass(frozen=True, slots=True)
class LabelledQuery:
    """A query with the ids of the nodes that answer it."""

    line: QueryLine
    kind: str
    relevant: frozenset[str]


@dataclass(frozen=True, slots=True)
class KindScore:
    """Precision of the first hit and of the first five over the queries of one kind, with 95 % intervals."""

    kind: str
    queries: int
    p1: Interval
    p5: Interval
    seconds: float  # median
    visited: float  # median

    def line(self) -> str:
        """The scores in one line."""
        return (
            f"{self.kind:<10} {self.queries:3d} queries  P@1 {self.p1}  P@5 {self.p5}  "
            f"median {self.seconds * 1000:.0f} ms, {self.visited:.0f} rows scored"
        )


def read_labelled(path: Path, where: Mapping[str, str]) -> list[LabelledQuery]:
    """The queries of a file that state `relevant` nodes. Raises InputError when none does."""
    found = list(_labelled(path, where))
    if not found:
        raise InputError("no query states relevant nodes", where=str(path), allowed='lines with "relevant": [ids]')
    return found


def evaluate(
    asker: Asker, path: Path, where: Mapping[str, str] | None = None, *, parts: Collection[str] = PARTS, top: int = 5
) -> list[KindScore]:
    """Ask every labelled query of a file; one score a kind, in the order kinds first appear.

    Of location, sensors and time window only those in `parts` are asked; the text always is.
    """
    queries = read_labelled(path, where or {})
    asker.warm_up()
    results = list(asker.ask_lines((_only(q.line, parts) for q in queries), top))
    kinds = dict.fromkeys(q.kind for q in queries)
    return [_score(kind, [(q, r) for q, r in zip(queries, results, strict=True) if q.kind == kind]) for kind in kinds]


def _only(line: QueryLine, parts: Collection[str]) -> QueryLine:
    """`line` without the conditions that are not in `parts`, where a text remains to be asked."""
    raw = line.raw or {}
    left_out = set(PARTS) - set(parts) if raw.get("query") else set()
    return replace(line, raw={key: value for key, value in raw.items() if key not in left_out})


def _labelled(path: Path, where: Mapping[str, str]) -> Iterator[LabelledQuery]:
    for line in read_queries(path, where):
        relevant = line.raw.get("relevant") if line.raw else None
        if line.raw is not None and relevant:
            yield LabelledQuery(line, str(line.raw.get("kind", "query")), frozenset(map(str, relevant)))


def _score(kind: str, asked: list[tuple[LabelledQuery, Result]]) -> KindScore:
    hits = [([h.node for h in r.hits], q.relevant) for q, r in asked]
    return KindScore(
        kind,
        len(asked),
        bootstrap([precision_at(nodes, relevant, 1) for nodes, relevant in hits]),
        bootstrap([precision_at(nodes, relevant, 5) for nodes, relevant in hits]),
        median(r.seconds for _, r in asked),
        median(r.visited for _, r in asked),
    )
