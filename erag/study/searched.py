"""What studies of fewer bits for search share: nodes with labelled queries, and a table of ways to search them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from erag.core.errors import InputError
from erag.core.text import node_text
from erag.core.types import IntArray
from erag.data.registry import read
from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.labelled import LabelledQuery, read_labelled
from erag.evaluate.ranking import precision_at
from erag.evaluate.statistics import Interval, bootstrap
from erag.study.quantcard import markdown
from erag.study.quantconfig import SearchStudy
from erag.study.shown import Shown


@dataclass(frozen=True)
class Labelled:
    """Nodes with a text, and queries whose relevant nodes are known."""

    ids: tuple[str, ...]
    texts: tuple[str, ...]
    queries: tuple[LabelledQuery, ...]

    def said(self) -> list[str]:
        """The texts of the queries."""
        return [str((q.line.raw or {})["query"]) for q in self.queries]


@dataclass(frozen=True)
class Way:
    """A way to search: what the study measured of it by column, P@1 and P@5."""

    name: str
    values: Mapping[str, float | Interval]
    first: Interval
    five: Interval

    @classmethod
    def of(
        cls, name: str, values: Mapping[str, float | Interval], found: Sequence[IntArray], data: Labelled
    ) -> Way:  # fmt: skip
        """With the precision of the rows that each query found."""
        hits = [([data.ids[row] for row in rows], q.relevant) for rows, q in zip(found, data.queries, strict=True)]
        first, five = ([precision_at(ids, relevant, k) for ids, relevant in hits] for k in (1, 5))
        return cls(name, values, bootstrap(first), bootstrap(five))


@dataclass(frozen=True)
class Report:
    """All ways. `columns` names what was measured beside precision, with how it is written."""

    title: str
    about: str
    columns: Mapping[str, str]
    ways: tuple[Way, ...]

    def table(self) -> Shown:
        """The figures for the terminal and the report."""
        rows = [
            (w.name, *(_written(w.values[c], form) for c, form in self.columns.items()), str(w.first), str(w.five))
            for w in self.ways
        ]
        numbers = tuple(c for c in self.columns if not isinstance(self.ways[0].values[c], Interval))
        return Shown(("way", *self.columns, "P@1", "P@5"), rows, numbers)

    def write(self, out: Path) -> None:
        """The report as a page in the folder `out`."""
        out.mkdir(parents=True, exist_ok=True)
        page = f"# {self.title}\n\n{self.about}\n\n{markdown(self.table())}\n"
        (out / "report.md").write_text(page, encoding="utf-8")


def labelled(config: SearchStudy) -> Labelled:
    """The nodes and queries of a study. Raises InputError where no node has a text."""
    path = sample_dir() if config.source == "sample" else Path(config.source)
    texts = {o.id: text for o in read(path).observations if (text := node_text(o.name, o.caption))}
    if not texts:
        raise InputError("no node has a text", where=str(path))
    file = sample_queries() if config.queries == "sample" else Path(config.queries)
    asked = [q for q in read_labelled(file, config.where) if (q.line.raw or {}).get("query")]
    return Labelled(tuple(texts), tuple(texts.values()), tuple(asked))


def about(config: SearchStudy, data: Labelled) -> str:
    """What was searched."""
    return f"{len(data.ids):,} nodes of `{config.source}`, {len(data.queries)} labelled queries; flat search."


def _written(value: float | Interval, form: str) -> str:
    return str(value) if isinstance(value, Interval) else format(value, form)
