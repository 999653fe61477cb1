"""The scores of one query's answers: P(Q|A), NI, P(Q|A,L), SPL, top-1 and top-5 (paper, metrics)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from erag.evaluate.location import nearness, spl, weighted, weighted_as_printed
from erag.evaluate.ranking import average_precision, ndcg_at, precision_at, reciprocal_rank, success_at
from erag.evaluate.statistics import Interval, bootstrap, clustered_bootstrap

PLACES = (1, 5)  # the paper's top-1 and top-5


@dataclass(frozen=True, slots=True)
class Answered:
    """One place of a ranking: the node, the panel's P(Q|A) for it, and ℓ in metres (None where no L was given)."""

    node: str
    probability: float
    metres: float | None = None
    on_edges: bool | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.probability <= 1:
            raise ValueError(f"P(Q|A) of {self.node!r} must lie in [0, 1], got {self.probability}")


@dataclass(frozen=True, slots=True)
class Ground:
    """What distances are held against: R in metres, and the metres to the nearest node that answers, where known."""

    radius_m: float
    shortest_m: float | None = None


@dataclass(frozen=True, slots=True)
class QueryScore:
    """All scores of one query, by the name of the metric; `environment` and `kind` are what tables group by."""

    id: str
    environment: str
    kind: str
    values: Mapping[str, float]


def top(values: Sequence[float], k: int) -> float:
    """The mean over the first k answers, always divided by k: an answer that is missing counts 0 (paper, metrics)."""
    if k < 1:
        raise ValueError(f"k must be at least 1, got {k}")
    return sum(values[:k]) / k


def answer_scores(answers: Sequence[Answered], ground: Ground | None = None) -> dict[str, float]:
    """`p_q_a@k`, and with `ground` `ni@k`, `p_q_a_l@k`, `p_q_a_l_printed@k` and `spl@k`, each for k = 1 and 5.

    A node answered twice counts 0 the second time. `on_edges@k` is the share of the lengths of the first k answers that
    run along edges, over the answers there are; it is left out where there is none. Raises ValueError for an answer
    without a length where there is `ground`, and as the functions of `location`.
    """
    kept = _first_of_each(answers)
    out = _at("p_q_a", [0.0 if a is None else a.probability for a in kept])
    if ground is None:
        return out
    lengths = [_metres(a) for a in answers]
    for name, formula in _formulas(ground).items():
        out |= _at(name, [0.0 if a is None else formula(a.probability, _metres(a)) for a in kept])
    for k in PLACES:
        known = [bool(a.on_edges) for a in answers[:k]]
        out |= {f"on_edges@{k}": sum(known) / len(known)} if known else {}
    return out | ({"metres@1": lengths[0]} if lengths else {})


def _formulas(ground: Ground) -> dict[str, Callable[[float, float], float]]:
    """What a probability and metres become, by the name of the metric."""
    radius, shortest = ground.radius_m, ground.shortest_m
    made: dict[str, Callable[[float, float], float]] = {
        "ni": lambda _, metres: nearness(metres, radius),
        "p_q_a_l": lambda probability, metres: weighted(probability, metres, radius),
        "p_q_a_l_printed": lambda probability, metres: weighted_as_printed(probability, metres, radius),
    }
    if shortest is not None:
        made["spl"] = lambda probability, metres: spl(probability, shortest, metres)
    return made


def ranking_scores(hits: Sequence[str], relevant: Collection[str]) -> dict[str, float]:
    """Scores of hits against labels: `precision@k`, `success@k`, `ndcg@5`, `mrr`, `map`. Raises ValueError for none."""
    found = {f"precision@{k}": precision_at(hits, relevant, k) for k in PLACES}
    found |= {f"success@{k}": success_at(hits, relevant, k) for k in PLACES}
    rest = {"ndcg@5": ndcg_at(hits, relevant, 5), "mrr": reciprocal_rank(hits, relevant)}
    return found | rest | {"map": average_precision(hits, relevant)}


def summarise(scores: Sequence[QueryScore], *, by_environment: bool = False, seed: int = 0) -> dict[str, Interval]:
    """Mean and 95 % interval of every metric over the queries that have it, in the order metrics first appear.

    Queries are drawn, or with `by_environment` whole environments. A query has every metric that can be computed for
    it, so that a system without an answer is in every mean with a 0; only `metres` and `on_edges` need an answer.
    """
    names = dict.fromkeys(name for score in scores for name in score.values)
    made = {}
    for name in names:
        having = [s for s in scores if name in s.values]
        values = [s.values[name] for s in having]
        made[name] = (
            clustered_bootstrap(values, [s.environment for s in having], seed=seed)
            if by_environment
            else bootstrap(values, seed=seed)
        )
    return made


def _at(name: str, values: Sequence[float]) -> dict[str, float]:
    return {f"{name}@{k}": top(values, k) for k in PLACES}


def _first_of_each(answers: Sequence[Answered]) -> list[Answered | None]:
    """The answers in their places, None for those whose node has been answered before."""
    seen, kept = set[str](), list[Answered | None]()
    for answer in answers:
        kept.append(None if answer.node in seen else answer)
        seen.add(answer.node)
    return kept


def _metres(answer: Answered) -> float:
    if answer.metres is None:
        raise ValueError(f"the answer {answer.node!r} has no path length")
    return answer.metres
