"""Answers in words held against golden ones: SS with controls, and fact coverage (paper, metrics)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.forest.terms import mentions, stem
from erag.lm.roles import Embedder

# What fits any place and says nothing: an SS that does not beat it is worth nothing.
GENERIC = (
    "This environment has various areas and objects, with buildings, paths and open spaces. It offers a range of "
    "features and can be used for different activities."
)
_MIN_HEAD = 2  # characters


@dataclass(frozen=True, slots=True)
class Golden:
    """A golden answer. `facts` are what a good answer has to say; empty means that they are read off the text."""

    text: str
    facts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TextScore:
    """One answer against its golden one.

    `ss` is the cosine of the two, `generic` that of `GENERIC` and the golden one, `echo` that of the question and the
    golden one. `coverage` is the share of golden facts the answer states, `contradicted` of those it denies, `facts`
    their number, and `generic_coverage` the coverage of `GENERIC`.
    """

    ss: float
    generic: float
    echo: float
    coverage: float
    contradicted: float
    generic_coverage: float
    facts: int

    @property
    def lift(self) -> float:
        """How far SS is above the better of the two controls, as a share of what was left: 1 is the golden answer."""
        control = max(self.generic, self.echo)
        return (self.ss - control) / (1 - control) if control < 1 else 0.0

    def values(self) -> dict[str, float]:
        """The score under the names of the tables."""
        return {
            "ss": self.ss, "ss_generic": self.generic, "ss_echo": self.echo, "ss_lift": self.lift,
            "fact_coverage": self.coverage, "fact_contradicted": self.contradicted,
            "fact_coverage_generic": self.generic_coverage,
        }  # fmt: skip


@dataclass(frozen=True)
class SemanticSimilarity:
    """SS by a fixed embedder with a name, so that a table can say by which; `retrieves` marks the one that retrieved.

    Embeddings of the model that also retrieved favour what it retrieved: a table has to say so.
    """

    name: str
    embedder: Embedder
    retrieves: bool = False

    def scores(self, questions: Sequence[str], answers: Sequence[str], golden: Sequence[Golden]) -> list[TextScore]:
        """One score for each answer. An empty answer is no answer: SS and coverage 0.

        Raises ValueError for unequal lengths or an empty golden answer.
        """
        if not len(questions) == len(answers) == len(golden):
            raise ValueError(f"{len(questions)} questions, {len(answers)} answers and {len(golden)} golden ones")
        if any(not g.text.strip() for g in golden):
            raise ValueError("a golden answer is empty")
        texts = sorted({t for t in (*questions, *answers, *(g.text for g in golden), GENERIC) if t.strip()})
        vectors = dict(zip(texts, np.asarray(self.embedder.embed(texts, "document"), np.float64), strict=True))

        def similarity(a: str, b: str) -> float:
            return float(np.clip(vectors[a] @ vectors[b], -1, 1)) if a.strip() else 0.0

        made = []
        for question, answer, wanted in zip(questions, answers, golden, strict=True):
            facts = golden_facts(wanted)
            stated, denied = fact_coverage(answer, facts)
            controls = (similarity(GENERIC, wanted.text), similarity(question, wanted.text))
            made.append(
                TextScore(
                    similarity(answer, wanted.text),
                    *controls,
                    stated,
                    denied,
                    fact_coverage(GENERIC, facts)[0],
                    len(facts),
                )
            )
        return made


@dataclass(frozen=True, slots=True)
class GoldenFact:
    """Something a golden answer says is there, or `absent`: the stems of the words that say so, the head last."""

    words: tuple[str, ...]
    absent: bool = False


def golden_facts(golden: Golden) -> tuple[GoldenFact, ...]:
    """The distinct facts of a golden answer: of its stated `facts`, else of the phrases its text affirms and denies."""
    found: dict[GoldenFact, None] = {}
    for text in golden.facts or (golden.text,):
        said = mentions(text)
        for phrases, absent in ((said.phrases, False), (said.denied, True)):
            for phrase in phrases:
                words = tuple(stem(w) for w in phrase.words if len(w) >= _MIN_HEAD)
                if words:
                    found.setdefault(GoldenFact(words, absent))
    return tuple(found)


def fact_coverage(answer: str, facts: Sequence[GoldenFact]) -> tuple[float, float]:
    """The shares of `facts` that `answer` states and contradicts; (0, 0) where there are no facts or no answer.

    A fact is stated when all its words are, in any order, on its side of a denial; contradicted when its head is on
    the other side and not on its own.
    """
    if not facts:
        return 0.0, 0.0
    said = mentions(answer)
    stated = contradicted = 0
    for fact in facts:
        own, other = (said.denied_words, said.words) if fact.absent else (said.words, said.denied_words)
        stated += all(word in own for word in fact.words)
        contradicted += fact.words[-1] in other and fact.words[-1] not in own
    return stated / len(facts), contradicted / len(facts)
