"""Queries from the ground truth: explicit, implicit and global; counting, change and unanswerable ones apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.sim import questions
from erag.sim.asking import Known, Line, query
from erag.sim.layout import World, generator
from erag.sim.phrases import look, pick
from erag.sim.truth import Seen, View
from erag.sim.vocabulary import article, classes, kin, plural, read_words, validated

EXPLICIT, IMPLICIT, UNANSWERABLE = 10, 10, 3  # of each a world; a town has TOWN times as many
LAST_SEEN = 6  # of these, half of things that have gone since, where there was a second visit
TOWN = 3
_FIND = (
    "Find {a}.", "Where is the nearest {name}?", "Take me to {a}.", "Show me {a}.", "Is there {a} around here?",
    "I am looking for {a}.", "Guide me to {a}, please.", "Which spot has {a}?",
)  # fmt: skip
_COMMON = 0.45  # a class seen at more than this share of the nodes is no target: finding it would say nothing
ASKING_AT = 0.5  # share of the find queries that state where the robot is
ASKING_SENSOR = 0.25  # share of the find queries of outdoor worlds that wish for low or high NDVI


class Wish(BaseModel):
    """A wish that names nothing: the classes that fulfil it, and ways to say it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    by: tuple[str, ...] = Field(min_length=1)
    say: tuple[str, ...] = Field(min_length=3)


@cache
def wishes() -> tuple[Wish, ...]:
    """All wishes of `words/wishes.yaml`."""
    return tuple(validated(Wish, raw, "wishes.yaml") for raw in read_words("wishes")["wishes"])


def queries(
    visits: Sequence[World], views: Sequence[View], setting: str, seed: int, *, objects: bool = True
) -> list[Line]:
    """The query lines of a world, the same for the same seed; `relevant` are the nodes that fulfil each.

    A node is relevant where what is asked covers at least `VISIBLE` of its image. With a wish for low (high) NDVI it
    also has to lie in the lower (upper) third of the world's readings; sensors are asked only in E-multimodal.
    """
    known = Known(visits, views, objects)
    rng = generator(seed, visits[0].name, "queries")
    scale = TOWN if len(visits[0].stops) > 1000 else 1
    sensors = setting == "e-multimodal" and visits[0].scene.setting != "indoor"
    lines = [
        *_explicit(known, rng, EXPLICIT * scale, sensors), *_implicit(known, rng, IMPLICIT * scale, sensors),
        *questions.describing(known, rng), *questions.counting(known, rng, 2 * scale), *questions.changes(known),
        *_unanswerable(known, rng, UNANSWERABLE * scale),
        *questions.sightings(known, generator(seed, visits[0].name, "last seen"), LAST_SEEN * scale),
    ]  # fmt: skip
    return [line | {"id": f"{known.name}-q{i:03d}"} for i, line in enumerate(lines, start=1)]


def _explicit(known: Known, rng: np.random.Generator, count: int, sensors: bool) -> Iterator[Line]:
    """Find this class, some by their looks; classes are drawn without repetition."""
    names = [n for n in known.nodes_by_class if _rare(known, kin(n))]
    for name in rng.permutation(names)[:count].tolist():
        seen = [o for v in known.views for o in v.visible if o.name == name]
        looks = sorted({look(o) for o in seen})
        chosen = pick(rng, looks) if len(looks) > 1 and rng.random() < 0.5 else None
        nodes = known.nodes(*kin(name)) if chosen is None else _by_look(known, name, chosen)
        what = chosen or name
        text = pick(rng, _FIND).format(a=article(what), name=what)
        target = " or ".join(kin(name) if chosen is None else (name,))
        yield from _found(known, "explicit", text, nodes, rng, sensors, target)


def _implicit(known: Known, rng: np.random.Generator, count: int, sensors: bool) -> Iterator[Line]:
    able = [w for w in wishes() if _rare(known, w.by)]
    for row in rng.permutation(len(able))[:count].tolist():
        wish = able[row]
        yield from _found(
            known, "implicit", pick(rng, wish.say), known.nodes(*wish.by), rng, sensors, " or ".join(wish.by)
        )


def _found(
    known: Known,
    kind: questions.FindKind,
    text: str,
    nodes: Sequence[str],
    rng: np.random.Generator,
    sensors: bool,
    target: str,
) -> Iterator[Line]:
    """A find query, with a location or a wish for a sensor's reading now and then."""
    at = known.place(rng) if rng.random() < ASKING_AT else None
    wish = questions.WISHES[int(rng.integers(2))]
    fitting = known.with_ndvi(nodes, wish) if sensors and rng.random() < ASKING_SENSOR else []
    relevant, sensor = (fitting, {"ndvi": wish}) if fitting else (list(nodes), None)
    yield query(known, kind, "find", text, at=at, sensor=sensor, relevant=relevant, target=target)


def _by_look(known: Known, name: str, chosen: str) -> list[str]:
    def fits(o: Seen) -> bool:
        return o.name == name and look(o) == chosen

    nodes = [v.node for v in known.views if any(fits(o) for o in v.visible)]
    ids = {f"{o.instance}@{'ab'[v.visit - 1]}": None for v in known.views for o in v.visible if fits(o)}
    return [*nodes, *(ids if known.objects else ())]


def _rare(known: Known, names: Sequence[str]) -> bool:
    """Whether something of these classes is visible somewhere, and not nearly everywhere."""
    places = {v.node for v in known.views}
    nodes = [n for n in known.nodes(*names) if n in places]
    return 0 < len(nodes) <= _COMMON * len(places)


def _unanswerable(known: Known, rng: np.random.Generator, count: int) -> Iterator[Line]:
    """Classes and wishes for which there is nothing in this world at all, not even unseen."""
    there = {t.name for world in known.visits for t in world.things if t is not None}
    said = giveaways(sorted(there))
    title = known.visits[0].scene.title
    names = [n for n in classes() if n not in there and n not in title and not giveaways((n,)) & said]
    able = [w for w in wishes() if not there & set(w.by)]
    for name in rng.permutation(names)[: count - 1].tolist():
        text = pick(rng, _FIND).format(a=article(name), name=name)
        yield query(known, "explicit", "unanswerable", text, relevant=[], target=name)
    for row in rng.permutation(len(able))[:1].tolist():
        yield query(
            known, "implicit", "unanswerable", pick(rng, able[row].say), relevant=[], target=" or ".join(able[row].by)
        )


def giveaways(names: Sequence[str]) -> set[str]:
    """The words that an implicit query about these classes must not contain."""
    said = {w for n in names for w in (n, plural(n), *classes()[n].words)}
    return {w.lower() for w in said} | {part.lower() for n in names for part in n.split() if len(part) > 2}
