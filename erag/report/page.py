"""The page itself: facts worded, templates filled, style and script put inside."""

from __future__ import annotations

import base64
import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erag.core.errors import ConfigError, printable
from erag.core.output import replacing
from erag.core.times import format_time
from erag.core.types import EdgeKind, Frame, Interval, TopoMap
from erag.data.reading import Issue
from erag.report.asking import Asked
from erag.report.chart import Chart, chart, palette
from erag.report.config import ReportConfig
from erag.report.memory import Shown
from erag.report.pictures import Pictures, thumbnails
from erag.report.questions import QuestionView, Wording
from erag.report.records import records
from erag.report.tree import steps

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = "templates"
_EDGES = {
    EdgeKind.PATH: "driven", EdgeKind.RADIUS: "near each other", EdgeKind.BRIDGE: "bridged, not driven",
    EdgeKind.OBSERVED_FROM: "an object and where it was seen from",
}  # fmt: skip


@dataclass(frozen=True)
class Page:
    """A finished page: its HTML, one line that says what it holds, and the images it could not show."""

    html: str
    line: str
    issues: tuple[Issue, ...]


def render(shown: Shown, asked: Sequence[Asked] = (), config: ReportConfig | None = None) -> Page:
    """The page of a memory and the questions asked of it.

    It holds no address but `data:`, and its policy forbids the browser every request. Raises ConfigError where a
    package is missing.
    """
    config = config or ReportConfig()
    environment = _environment()
    topomap, forest = shown.topomap, shown.forest
    wording = Wording(topomap, forest, seconds=config.seconds)
    questions = [wording.view(one) for one in asked]
    pictures = _pictures(shown, questions, config)
    drawn = chart(topomap, forest)
    style, script = _text("style.css") + palette(), _text("page.js")
    html = environment.get_template("page.html").render(
        shown=shown, chart=drawn, steps=steps(forest, topomap), questions=questions, style=style, script=script,
        policy=_policy(style, script), facts=_facts(shown, pictures), counts=_counts(shown, drawn, questions),
        edges={kind.name.lower(): told for kind, told in _EDGES.items()}, opened=_opened(questions),
        issues=pictures.issues, data=records(topomap, forest, drawn, questions, pictures.by_row),
        wgs84=topomap.frame is Frame.WGS84,
    )  # fmt: skip
    return Page(html, _line(shown, questions, pictures), pictures.issues)


def write_page(page: Page, out: Path, *inputs: Path) -> str:
    """Write a page; returns a line that says what was written. Raises InputError as `erag.core.output.replacing`."""
    with replacing(out, *inputs) as file:
        file.write(page.html)
    return f"{out}: {page.line}, {out.stat().st_size / 1e6:.1f} MB"


def _environment() -> Environment:
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ModuleNotFoundError as error:
        raise ConfigError("the package Jinja2 is not installed", repair="pip install 'erag[report]'") from error
    environment = Environment(
        loader=PackageLoader("erag.report", TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "separators": (",", ":")}
    environment.filters["said"] = lambda text: printable(str(text), 4000)
    return environment


def _text(name: str) -> str:
    return (files("erag.report") / TEMPLATES / name).read_text(encoding="utf-8")


def _policy(style: str, script: str) -> str:
    """A Content-Security-Policy under which nothing is requested and nothing runs but our own style and script."""
    return (
        f"default-src 'none'; img-src data:; style-src {_hash(style)}; script-src {_hash(script)}; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _pictures(shown: Shown, questions: Sequence[QuestionView], config: ReportConfig) -> Pictures:
    """Thumbnails, those of hits first."""
    wanted = {hit.row for question in questions for hit in question.hits}
    ordered = sorted(shown.images, key=lambda image: (image.row not in wanted, image.row))
    return thumbnails(ordered, config.pictures)


def _opened(questions: Sequence[QuestionView]) -> int:
    """The question that is open at first: the first with a route, else with a waypoint, else the first."""
    with_way = [i for i, q in enumerate(questions) if len(q.way) > 1]
    with_goal = [i for i, q in enumerate(questions) if q.goal is not None]
    return [*with_way, *with_goal, 0][0]


def _counts(shown: Shown, drawn: Chart, questions: Sequence[QuestionView]) -> list[tuple[int, str, str]]:
    """(number, of what, of which) for the tiles of the page's head."""
    kinds = Counter(node.kind for node in shown.topomap.nodes)
    answered = Counter(q.status for q in questions)
    told = {"find": "found", "explain": "explained", "refused": "refused", "error": "failed"}
    return [
        (len(shown.topomap), "nodes", _listed({f"{kind}s": n for kind, n in kinds.items()})),
        (len(shown.topomap.edges), "edges", _listed({s.kind.replace("_", " "): s.count for s in drawn.strokes})),
        (len(shown.forest.clusters), "clusters", f"{len(shown.forest.roots):,} at the top"),
        (int(shown.forest.level.max(initial=0)), "levels", "above the nodes"),
        (len(questions), "questions", _listed({told[s]: n for s, n in answered.items()})),
    ]


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{n:,} {name}" for name, n in counts.items())


def _facts(shown: Shown, pictures: Pictures) -> list[tuple[str, str]]:
    """What is said of the memory below the tiles, without what is unknown."""
    models: dict[str, list[str]] = {}
    for role, model in shown.models.items():
        models.setdefault(model, []).append(role)
    facts = {
        "Source": ", ".join(shown.sources),
        "Seen": _span(shown.topomap),
        "Frame": {Frame.WGS84: "longitude and latitude (WGS84)", Frame.METRIC: "metres"}[shown.topomap.frame],
        "Images": f"{len(pictures.by_row):,} of {len(shown.images):,} shown" if shown.images else "",
        "Preset": shown.preset,
        "Models": "; ".join(f"{model} ({', '.join(roles)})" for model, roles in models.items()),
    }
    return [(name, value) for name, value in facts.items() if value]


def _span(topomap: TopoMap) -> str:
    times = [node.time for node in topomap.nodes if node.time is not None]
    if not times:
        return ""
    first, last = min(t.start for t in times), max(t.end for t in times)
    days = (format_time(Interval(moment, moment))[:10] for moment in (first, last))
    return " to ".join(dict.fromkeys(days))


def _line(shown: Shown, questions: Sequence[QuestionView], pictures: Pictures) -> str:
    holds: dict[str, Any] = {
        "nodes": len(shown.topomap), "clusters": len(shown.forest.clusters), "questions": len(questions),
        "pictures": len(pictures.by_row),
    }  # fmt: skip
    return _listed(holds)
