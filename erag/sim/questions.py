"""Questions whose answers are texts: global ones with golden answers, counting, and what has changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from erag.core.times import format_time, parse_time
from erag.core.types import Interval
from erag.sim.asking import Kind, Known, Line, Wish, moment, query
from erag.sim.phrases import capital, listed, number, pick
from erag.sim.vocabulary import article, classes, kin, plural

FindKind = Literal["explicit", "implicit"]
WISHES: tuple[Wish, Wish] = ("low", "high")
_COUNTABLE = (2, 9)  # instances of a class that are worth counting
_GRASS = ("lush grass", "patchy grass", "dry yellow grass", "flowering meadow")


def describing(known: Known, rng: np.random.Generator) -> Iterator[Line]:
    """Global queries: what kind of place, what there is, its parts, vegetation, season and light."""
    asked = (_kind(known, rng), _things(known, rng), _parts(known, rng), _vegetation(known), _conditions(known))
    for text, answer in (pair for pair in asked if pair):
        yield query(known, "global", "describe", text, golden_answer=answer)


def _kind(known: Known, rng: np.random.Generator) -> tuple[str, str]:
    scene = known.visits[0].scene
    text = pick(
        rng, ("What kind of place is this?", "Describe this environment as a whole.", "Where did the robot drive?")
    )
    side = {"indoor": "indoors", "outdoor": "outdoors", "mixed": "partly indoors and partly outdoors"}[scene.setting]
    things = [plural(n) for n, _ in _most_seen(known)[:5]]
    return text, f"This is {article(scene.title)}, {side}. Among what can be seen are {listed(things)}."


def _things(known: Known, rng: np.random.Generator) -> tuple[str, str]:
    text = pick(
        rng,
        ("Which objects are seen most often here?", "What is there to see here?", "Sum up what stands around here."),
    )
    most = [plural(n) for n, _ in _most_seen(known)[:7]]
    return text, f"Most often one sees {listed(most)}."


def _parts(known: Known, rng: np.random.Generator) -> tuple[str, str] | None:
    names = [
        n for n, _ in Counter(v.place_name for v in known.views).most_common(8) if n != known.visits[0].scene.title
    ]
    if len(names) < 2:
        return None
    text = pick(
        rng, ("Which parts does this place have?", "How is this place divided?", "What areas can be told apart here?")
    )
    return text, f"It has {number(len(names))} main parts: {listed(['the ' + n for n in names])}."


def _vegetation(known: Known) -> tuple[str, str] | None:
    """The trend of the vegetation, from the surfaces seen and the NDVI of the nodes."""
    if known.visits[0].scene.setting == "indoor":
        return None
    readings = np.array([v.ndvi for v in known.views if v.visit == 1])
    shares = {g: float(np.mean([v.surfaces.get(g, 0.0) for v in known.views if v.visit == 1])) for g in _GRASS}
    seen = [g for g, s in sorted(shares.items(), key=lambda item: -item[1]) if s > 0.01]
    best = max((v for v in known.views if v.visit == 1), key=lambda v: v.ndvi)
    worst = min((v for v in known.views if v.visit == 1), key=lambda v: v.ndvi)
    level = "dense" if readings.mean() > 0.45 else "moderate" if readings.mean() > 0.25 else "sparse"
    ground = f"The ground shows {listed(seen)}. " if seen else "There is hardly any grass. "
    trend = f"It is greenest at the {best.place_name} and barest at the {worst.place_name}."
    return "What is the vegetation trend here?", f"The vegetation is {level}. {ground}{trend}"


def _conditions(known: Known) -> tuple[str, str] | None:
    visits = [w.when for w in known.visits]
    if known.visits[0].scene.setting == "indoor":
        return None
    said = [f"in {v.season}, {_light(v.light)}, with {_WEATHER[v.weather]}" for v in visits]
    return "In which season and weather was this place seen?", f"It was seen {' and again '.join(said)}."


_WEATHER: Mapping[str, str] = {
    "clear": "a clear sky",
    "cloudy": "clouds",
    "misty": "mist",
    "snow": "snow on the ground",
}


def _light(light: str) -> str:
    said = {"morning": "in the morning", "midday": "around noon", "evening": "in the evening", "night": "at night"}
    return said.get(light, "during the day")


def counting(known: Known, rng: np.random.Generator, count: int) -> Iterator[Line]:
    """How many of a class there are: those that were visible on the first visit, each instance once."""
    low, high = _COUNTABLE
    able = [n for n, ids in known.instances.items() if low <= len(ids) <= high and not classes()[n].big]
    for name in rng.permutation(able)[:count].tolist():
        n = len(known.instances[name])
        text = pick(rng, ("How many {p} are there?", "Count the {p}.", "What is the number of {p} here?")).format(
            p=plural(name)
        )
        yield query(
            known, "global", "count", text, golden_answer=f"There are {number(n)} {plural(name)}.", count=n, target=name
        )


def changes(known: Known) -> Iterator[Line]:
    """What is different on the second visit: which things have gone, which came, which season it is."""
    if len(known.visits) < 2:
        return
    before, after = ({t.id: t.name for t in w.things if t is not None} for w in known.visits)
    seen = {v: {o.instance for x in known.views if x.visit == v for o in x.visible} for v in (1, 2)}
    gone = sorted({before[i] for i in before.keys() - after.keys() if i in seen[1]})
    came = sorted({after[i] for i in after.keys() - before.keys() if i in seen[2]})
    if gone:
        answer = f"Since the first visit {_some(gone)} {'is' if len(gone) == 1 else 'are'} gone."
        yield _changed(known, "What has disappeared since the first visit?", answer, gone)
    if came:
        answer = f"{capital(_some(came))} {'was' if len(came) == 1 else 'were'} not there before."
        yield _changed(known, "What is new since the first visit?", answer, came)
        yield from (_arrived(known, name) for name in came)
    first, second = (w.when for w in known.visits)
    if known.visits[0].scene.setting != "indoor":
        answer = f"First it was {first.season}, the second time {second.season}, with {_WEATHER[second.weather]}."
        yield _changed(known, "How do the two visits differ in season and weather?", answer, ())


def _some(names: Sequence[str]) -> str:
    return listed([article(n) for n in names])


def _changed(known: Known, text: str, answer: str, names: Sequence[str]) -> Line:
    return query(known, "global", "change", text, golden_answer=answer, target=", ".join(names) or None)


def _arrived(known: Known, name: str) -> Line:
    """Find something that came since the first visit; only nodes of the second visit are relevant."""
    nodes = [n for n in known.nodes(name) if n.endswith("@b") or n.startswith(f"{known.name}-b-")]
    text = f"Find {article(name)} that is there now."
    since = known.visits[1].when.start
    return query(known, "explicit", "change", text, relevant=nodes, since=since, target=name)


def sightings(known: Known, rng: np.random.Generator, count: int) -> Iterator[Line]:
    """When and where something was last seen; what has gone since comes first, where there was a second visit.

    `seen_at` is the true moment; `relevant` are the nodes of the last minute of that visit in which it was visible.
    """
    moments = _moments(known)
    last = {name: max(nodes, key=lambda n: moments[n]) for name, nodes in _places(known).items()}
    early = [n for n, node in last.items() if len(known.visits) > 1 and moments[node] < _second(known)]
    rest = [n for n in last if n not in early and len(_places(known)[n]) < _OFTEN * len(known.views)]
    gone = rng.permutation(sorted(early)).tolist()[: count // 2]
    chosen = [*gone, *rng.permutation(sorted(rest)).tolist()[: count - len(gone)]]
    for number_, name in enumerate(chosen):
        node = last[name]
        at = moments[node]
        near = [n for n in _places(known)[name] if at - _EPISODE_S <= moments[n] <= at and _visit(n) == _visit(node)]
        kind, sayings = _LAST[number_ % len(_LAST)]
        text = pick(rng, sayings).format(a=article(name), the=f"the {name}", name=name)
        when = format_time(Interval(at, at))
        place = next(v.place_name for v in known.views if v.node == node)
        answer = f"{capital(article(name))} was last seen on {when[:10]} at {when[11:16]}, in the {place}."
        yield query(known, kind, "last_seen", text, golden_answer=answer, relevant=near, seen_at=when, target=name)


_OFTEN, _EPISODE_S = 0.3, 60.0  # seen at more of the nodes it is no target; seconds that count as one sighting
_LAST: tuple[tuple[Kind, tuple[str, ...]], ...] = (
    ("explicit", ("Where did you last see {a}?", "Where was {the} last seen?", "Take me to where you last saw {a}.",
                  "Show me the place where {a} was seen last.")),
    ("global", ("When did you last see {a}?", "When was {the} last seen?", "At what time did you last notice {a}?",
                "On which day was {a} seen for the last time?")),
    ("global", ("How long ago did you see {a}?", "How long ago was {the} last seen?",
                "How long has it been since you saw {a}?")),
)  # fmt: skip


def _moments(known: Known) -> dict[str, float]:
    """UTC seconds at which the robot was at each place node."""
    worlds = {w.visit: w for w in known.visits}
    return {v.node: moment(worlds[v.visit], int(v.node.rsplit("-", 1)[1])) for v in known.views}


def _second(known: Known) -> float:
    return parse_time(known.visits[1].when.start).start


def _visit(node: str) -> str:
    return node.rsplit("-", 2)[1]


def _places(known: Known) -> dict[str, list[str]]:
    """Class -> place nodes at which one is visible; those of classes that count as it too."""
    shown = {v.node for v in known.views}
    return {n: [p for p in known.nodes(*kin(n)) if p in shown] for n in known.nodes_by_class if not classes()[n].big}


def _most_seen(known: Known) -> list[tuple[str, int]]:
    counts = Counter(name for v in known.views for name in {o.name for o in v.visible})
    return sorted(counts.items(), key=lambda item: (-item[1], item[0]))
