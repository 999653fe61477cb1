"""What the weight of location buys: how often the first hit is right, and how far the way to it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import cycle, product
from pathlib import Path

import numpy as np

from erag.bench.config import LocationBench
from erag.bench.worlds import LabelledWorld, labelled_worlds
from erag.core.progress import Progress, quiet
from erag.core.types import IntArray, Pose, Query
from erag.evaluate.location import nearness, radius
from erag.evaluate.metrics import Interval, bootstrap
from erag.lm.weights import ModelStore
from erag.pipeline.query import Asker, metered
from erag.topomap.routes import Router

NEAREST = "nearest right node"  # the choice of whoever knows the truth
_INK, _PALE = "#1f3a5f", "#9db4cc"
_LINES = ("o-", "s--", "^:", "v-.")
_APART = (0.08, 0.04)  # a weight is written only so far from the last one, in units of R and P@1


@dataclass(frozen=True, slots=True)
class LocationScore:
    """The first hits of the questions of one `kind` with one weight of location in one of the forms.

    `right` is P@1, `path` the way to the first hit in units of R, `near` P@1 · NI.
    """

    form: str
    weight: str
    kind: str
    questions: int
    right: Interval
    path: Interval
    near: Interval


@dataclass(frozen=True, slots=True)
class _Posed:
    """A question asked from a place, and the rows of the nodes that answer it."""

    kind: str
    query: Query
    relevant: IntArray


@dataclass(frozen=True, slots=True)
class _First:
    form: str
    weight: str
    kind: str
    right: float
    path: float


def run(config: LocationBench, store: ModelStore, progress: Progress = quiet) -> Iterator[LocationScore]:
    """A score a weight and kind of question, and that of the nearest right node; all from the same places."""
    models, found = metered(config.pipeline, store), list[_First]()
    for world in labelled_worlds(config.worlds, config.pipeline, store, progress):
        for form, weight in product(config.forms, config.weights):
            pipeline = config.pipeline.model_copy(update={"retrieve": config.retrieve(form, weight)})
            asker = Asker(world.memory, pipeline, store, models)
            posed = list(_posed(world, asker, config.seed))
            found += _firsts(form, f"{weight:g}", asker, posed)
        found += _nearest(asker, posed)
    for asked in dict.fromkeys((f.form, f.weight, f.kind) for f in found):
        some = [f for f in found if (f.form, f.weight, f.kind) == asked]
        right, path = [f.right for f in some], [f.path for f in some]
        near = [r * nearness(p, 1.0) for r, p in zip(right, path, strict=True)]
        yield LocationScore(*asked, len(some), bootstrap(right), bootstrap(path), bootstrap(near))


def _posed(world: LabelledWorld, asker: Asker, seed: int) -> Iterator[_Posed]:
    """The find questions of a world without a wish for readings: from where they say, else from a node drawn."""
    topomap, rng = asker.corpus.topomap, np.random.default_rng(seed)
    for question in world.finds:
        stated = (question.line.raw or {}).get("at")
        drawn = topomap.nodes[int(rng.integers(len(topomap)))].pose.xyz
        rows = sorted(topomap.row[node] for node in question.relevant or () if node in topomap.row)
        if rows:
            at = Pose(*(float(v) for v in stated or drawn))
            yield _Posed(question.kind, Query(question.text, at, top=1, id=question.id), np.array(rows, np.int64))


def _firsts(form: str, weight: str, asker: Asker, posed: Sequence[_Posed]) -> Iterator[_First]:
    """The first hit of each question; one without a hit is wrong, and its way as long as R."""
    topomap = asker.corpus.topomap
    router, r = Router(topomap), radius(topomap)
    for one in posed:
        hits = asker.ask(one.query).hits
        if not hits or one.query.at is None:
            yield _First(form, weight, one.kind, 0.0, 1.0)
            continue
        row = topomap.row[hits[0].node]
        metres, _ = router.path_or_straight(one.query.at, np.array([row]))
        yield _First(form, weight, one.kind, float(row in one.relevant), float(metres[0]) / r)


def _nearest(asker: Asker, posed: Sequence[_Posed]) -> Iterator[_First]:
    topomap = asker.corpus.topomap
    router, r = Router(topomap), radius(topomap)
    for one in posed:
        if one.query.at is not None:
            metres, _ = router.path_or_straight(one.query.at, one.relevant)
            yield _First("", NEAREST, one.kind, 1.0, float(metres.min()) / r)


def plotted(scores: Sequence[LocationScore], path: Path) -> bool:
    """Draw P@1 over the way to the first hit, a curve a kind of question and form; False without matplotlib."""
    if find_spec("matplotlib") is None:
        return False
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for kind, ink in zip(dict.fromkeys(s.kind for s in scores), (_INK, "#b0552b", _PALE), strict=False):
        curves = [s for s in scores if s.kind == kind and s.weight != NEAREST]
        for form, line in zip(dict.fromkeys(s.form for s in curves), cycle(_LINES), strict=False):
            curve = [s for s in curves if s.form == form]
            ways, right = [s.path.mean for s in curve], [s.right.mean for s in curve]
            axes.plot(ways, right, line, color=ink, label=f"{kind} {form}".strip(), markersize=4)
            told = (np.inf, np.inf)
            for s in curve:
                at = (s.path.mean, s.right.mean)
                if abs(at[0] - told[0]) > _APART[0] or abs(at[1] - told[1]) > _APART[1]:
                    axes.annotate(s.weight, at, xytext=(4, 5), textcoords="offset points", fontsize=7)
                    told = at
        best = [s for s in scores if s.kind == kind and s.weight == NEAREST]
        axes.plot([s.path.mean for s in best], [s.right.mean for s in best], "*", color=ink, markersize=9)
    axes.set_xlabel("way to the first hit, in units of R (star: the nearest right node)")
    axes.set_ylabel("P@1")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, metadata={"Software": None})
    return True
