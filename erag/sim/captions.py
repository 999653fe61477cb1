"""Ground-truth captions: two to four sentences of fluent English about what a frame shows, from its truth alone."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from erag.sim.layout import Thing, World
from erag.sim.phrases import capital, grouped, listed, phrases, pick
from erag.sim.truth import Seen, View, colour_of, shape_of
from erag.sim.vocabulary import article, classes

MOST = 7  # groups of objects that a caption names
FAR = 14.0  # metres from which on things are in the distance
Table = Mapping[str, Sequence[str]]


def caption(view: View, title: str) -> str:
    """The caption of a view in the world called `title`, always the same for the same view."""
    rng = np.random.default_rng(zlib.crc32(view.node.encode()))
    groups = groups_of(view.visible)[:MOST]
    sentences = [_opening(view, title, rng)]
    if not groups:
        sentences.append(pick(rng, phrases()["empty"]["indoor" if view.indoor else "outdoor"]))
    else:
        first, rest = _main(groups, rng)
        sentences.append(first)
        sentences += _others(rest, rng)
    if view.surfaces and ((len(sentences) < 4 and rng.random() < 0.5) or not groups):
        sentences.append(_ground(view, rng))
    return " ".join(sentences)


def object_caption(thing: Thing, world: World) -> str:
    """The caption of an object's own node: its look and where it stands."""
    seen = Seen(
        thing.id, thing.name, shape_of(thing), colour_of(thing), 1.0, (0, 0, 1, 1), "centre", 1.0, thing.style.text
    )
    where = world.scene.areas[thing.area].name
    return f"{capital(grouped([seen]))} in the {where} of {article(world.scene.title)}."


def groups_of(seen: Sequence[Seen]) -> list[list[Seen]]:
    """Objects by class, the most prominent class first; what fills the view by its size comes after the rest."""
    groups: dict[str, list[Seen]] = {}
    for o in seen:
        groups.setdefault(o.name, []).append(o)
    return sorted(
        groups.values(), key=lambda g: (classes()[g[0].name].big and g[0].share < 0.2, -sum(o.share for o in g))
    )


def _opening(view: View, title: str, rng: np.random.Generator) -> str:
    table = phrases()
    time = pick(rng, table["time"][view.light])
    when = pick(rng, table["when"][view.weather]).format(season=view.season, time=time)
    place = f"the {view.place_name}" if view.place_name != title else "an open part"
    pattern = pick(rng, table["opening"]["indoor" if view.indoor else "outdoor"])
    text = pattern.format(place=place, Place=capital(place), title=title, when=when)
    return (
        text.replace("a " + title, article(title))
        .replace("A " + when, capital(article(when)))
        .replace("a " + when, article(when))
    )


def _main(groups: list[list[Seen]], rng: np.random.Generator) -> tuple[str, list[list[Seen]]]:
    """A sentence about the first group, and a companion if there is one, with the groups that are left."""
    main, rest = groups[0], groups[1:]
    sentence = _placed(pick(rng, phrases()["first"][main[0].side]), main)
    companion = next((g for g in rest if g[0].instance in main[0].beside), rest[0] if rest else None)
    if companion is not None:
        rest = [g for g in rest if g is not companion]
        relation = "beside" if companion[0].instance in main[0].beside else _relative(main[0], companion[0])
        joined = pick(rng, phrases()["with"][relation]).format(other=grouped(companion))
        sentence = f"{sentence}, {joined}" if relation != "beside" else f"{sentence} {joined}"
    return f"{sentence}.", rest


def _others(rest: Sequence[list[Seen]], rng: np.random.Generator) -> list[str]:
    """At most two sentences about the remaining groups: those near, and those far away."""
    near = [g for g in rest if g[0].metres < FAR]
    far = [g for g in rest if g[0].metres >= FAR]
    return [_all(pick(rng, phrases()["rest"][key]), groups) for key, groups in (("near", near), ("far", far)) if groups]


def _all(pattern: str, groups: Sequence[list[Seen]]) -> str:
    things = listed([grouped(g) for g in groups])
    many = len(groups[0]) > 1 if pattern.startswith(("There", "Further")) else len(groups) > 1 or len(groups[0]) > 1
    return pattern.format(things=things, Things=capital(things), **_verbs(many))


def _placed(pattern: str, group: Sequence[Seen]) -> str:
    thing = grouped(group)
    return pattern.format(thing=thing, Thing=capital(thing), **_verbs(len(group) > 1))


def _verbs(many: bool) -> dict[str, str]:
    return {"is": "are", "stands": "stand"} if many else {"is": "is", "stands": "stands"}


def _relative(main: Seen, other: Seen) -> str:
    shift = (other.box[0] + other.box[2]) / 2 - (main.box[0] + main.box[2]) / 2
    return "right" if shift > 0.15 else "left" if shift < -0.15 else "centre"


def _ground(view: View, rng: np.random.Generator) -> str:
    surface = next(iter(view.surfaces))
    pattern = pick(rng, phrases()["ground"]["night" if view.light == "night" else "any"])
    return pattern.format(surface=surface, Surface=capital(surface))
