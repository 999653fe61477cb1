"""The capabilities of the paper's Table I, each read off a run: in how many answers it held, and what was seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from erag.experiment.markdown import Sheet
from erag.experiment.scoring import Scored

Check = Callable[[Scored], bool]
Seen = Callable[[Sequence[Scored], Sequence[Scored]], str]  # of these answers, and of those by text alone


@dataclass(frozen=True)
class Capability:
    """What the paper names, the mode it is asked in, when it holds for an answer, and what a reader can see."""

    name: str
    mode: str
    what: str
    holds: Check
    seen: Seen
    explain: bool = False
    needs: str = "seconds"  # the metric without which an answer says nothing of it


def capabilities(scores: Sequence[Scored], systems: Sequence[str]) -> list[Sheet]:
    """A row a capability, a column a system; a capability nobody was asked for is not in the table."""
    rows = []
    for one in CAPABILITIES:
        cells = [_cell(one, [s for s in scores if s.prediction.system == name]) for name in systems]
        if any(cells):
            rows.append((one.name, one.mode, one.what, *(cell or "not asked" for cell in cells)))
    columns = ("capability", "asked", "holds where", *systems)
    notes = ("Each cell: the answers in which it held, of those asked; then what was seen.",)
    return [Sheet("capabilities", "Capabilities, each shown by a run", columns, tuple(rows), notes)] if rows else []


def _cell(one: Capability, scores: Sequence[Scored]) -> str:
    asked = [s for s in scores if s.prediction.mode == one.mode and (s.prediction.kind == "explain") == one.explain]
    asked = [s for s in asked if one.needs in s.values]
    alone = [s for s in scores if s.prediction.mode == "Q" and s.prediction.kind == "find"]
    if not asked:
        return ""
    held = sum(one.holds(s) for s in asked)
    seen = one.seen(asked, alone)
    return f"{held} of {len(asked)}" + (f"; {seen}" if seen else "")


def _all_hits(*parts: str) -> Check:
    """Whether there are answers, the first with a score for each of the parts asked for."""

    def check(one: Scored) -> bool:
        hits = one.prediction.hits
        return bool(hits) and all(getattr(hits[0], part) is not None for part in parts)

    return check


def _metric(name: str) -> Check:
    return lambda one: one.values.get(name, 0.0) > 0


def _quiet(asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    del asked, alone
    return ""


def _nearer(asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    return _both("median metres to the first answer", "metres@1", asked, alone)


def _lower(asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    """How often the reading at the first answer went the way that was wished for, where it changed."""
    before = {s.prediction.question: s for s in alone}
    moved = [(s, before[s.prediction.question]) for s in asked if s.prediction.question in before]
    known = [(a, b) for a, b in moved if "reading@1" in a.values and "reading@1" in b.values]
    changed = [(a, b) for a, b in known if a.values["reading@1"] != b.values["reading@1"]]
    right = sum(_wished(a, a.values["reading@1"] - b.values["reading@1"]) for a, b in changed)
    return f"the reading at the first answer changed in {len(changed)} of {len(known)}, the way wished for in {right}"


def _wished(one: Scored, change: float) -> bool:
    wish = next(iter((one.question.sensor or {}).values()), "low")
    return change > 0 if wish == "high" else change < 0


def _both(what: str, name: str, asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    now = [s.values[name] for s in asked if name in s.values]
    keys = {s.prediction.question for s in asked}
    then = [s.values[name] for s in alone if name in s.values and s.prediction.question in keys]
    if not now or not then:
        return ""
    return f"{what}: {median(now):.1f}, by text alone {median(then):.1f}"


def _words(asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    del alone
    return f"median {median(len(s.prediction.text.split()) for s in asked):.0f} words"


def _way(asked: Sequence[Scored], alone: Sequence[Scored]) -> str:
    del alone
    lengths = [s.prediction.route_m for s in asked if s.prediction.route_m is not None]
    return f"median way {median(lengths):.1f} m" if lengths else ""


def _text(one: Scored) -> bool:
    return bool(one.prediction.text.strip()) and not one.prediction.refused


CAPABILITIES = (
    Capability("P(A|Q)", "Q", "the first answer has a semantic score", _all_hits("semantic"), _quiet),
    Capability("P(A|L)", "L", "the first answer is the nearest node", _metric("nearest@1"), _quiet, needs="nearest@1"),
    Capability("P(A|L,Q)", "Q,L", "it has a semantic and a spatial score", _all_hits("semantic", "spatial"), _nearer),
    Capability("P(A|S,Q)", "Q,S", "it has a semantic and a sensor score", _all_hits("semantic", "sensor"), _lower),
    Capability("P(A|S,L,Q)", "Q,L,S", "it has all three", _all_hits("semantic", "spatial", "sensor"), _lower),
    Capability("text", "Q", "an explain query has an answer in words", _text, _words, explain=True),
    Capability("waypoint", "Q,L", "the answer names a node to go to", _metric("waypoint"), _quiet),
    Capability("path", "Q,L", "a shortest way leads from L to it", _metric("path"), _way),
)
