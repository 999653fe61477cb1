"""Classes, materials and wishes: the YAML files agree with the builders and with each other."""

from __future__ import annotations

import re

import pytest

from erag.core.errors import ConfigError
from erag.sim.materials import Material, in_season, materials
from erag.sim.model import PALETTE, Style
from erag.sim.queries import giveaways, wishes
from erag.sim.shapes import BUILDERS
from erag.sim.vocabulary import article, classes, parse, plural, validated


def test_every_class_has_a_builder_and_every_builder_a_class() -> None:
    assert set(classes()) == set(BUILDERS)
    assert len(classes()) >= 60


@pytest.mark.parametrize("name", sorted(BUILDERS))
def test_every_look_is_built_of_known_materials(name: str) -> None:
    kind = classes()[name]
    for looks in filter(None, (kind.train, kind.held_out)):
        assert set(looks.colours) <= {"", *PALETTE}
        for shape in looks.shapes:
            parts = BUILDERS[name](Style(shape, next(iter(looks.colours), ""), next(iter(kind.texts), ""), 3))
            assert {p.material for p in parts} <= set(materials())
            assert min(p.mesh.vertices[:, 2].min() for p in parts) > -0.15, "stands in the ground"


def test_equal_styles_are_built_equal() -> None:
    for name in ("tree", "shelving rack", "maize plant"):
        a, b = (BUILDERS[name](Style(seed=7)) for _ in range(2))
        assert all((x.mesh.vertices == y.mesh.vertices).all() for x, y in zip(a, b, strict=True))


def test_some_looks_are_only_in_held_out_worlds() -> None:
    shapes = [n for n, k in classes().items() if k.held_out and set(k.held_out.shapes) - set(k.train.shapes)]
    colours = [n for n, k in classes().items() if k.held_out and set(k.held_out.colours) - set(k.train.colours)]
    assert len(shapes) >= 30
    assert len(colours) >= 40


def test_ndvi_follows_from_the_reflectances() -> None:
    good, worn, dry = (materials()[g] for g in ("good grass", "worn grass", "dry grass"))
    assert good.ndvi == pytest.approx((0.50 - 0.05) / (0.50 + 0.05))
    assert good.ndvi > worn.ndvi > dry.ndvi > materials()["asphalt"].ndvi
    assert all(-1 <= m.ndvi <= 1 for m in materials().values())
    assert materials()["water"].ndvi < 0


def test_seasons_lead_to_materials() -> None:
    for name, material in materials().items():
        assert set(material.seasons.values()) <= set(materials()), name
    assert in_season("leaves", "autumn", snow=False) == "autumn leaves"
    assert in_season("good grass", "winter", snow=True) == "snow"
    assert in_season("brick", "winter", snow=True) == "brick"


def test_an_unknown_texture_is_named() -> None:
    with pytest.raises(ConfigError, match="velvet"):
        validated(Material, {"texture": "velvet", "first": [1, 2, 3], "red": 0.1, "nir": 0.2}, "here")


def test_yaml_that_is_no_mapping_is_refused() -> None:
    with pytest.raises(ConfigError, match="not a mapping"):
        parse("- a\n- b\n", "here")
    with pytest.raises(ConfigError, match="not YAML"):
        parse("a: [", "here")


def test_a_wish_names_nothing_that_fulfils_it() -> None:
    for wish in wishes():
        assert set(wish.by) <= set(classes())
        given = giveaways(wish.by)
        for text in wish.say:
            words = set(re.findall(r"[a-z-]+", text.lower()))
            words |= {w.removesuffix("s") for w in words}
            named = {g for g in given if g in words or (" " in g and g in text.lower())}
            assert not named, (text, named)


def test_wishes_cover_most_classes_in_several_phrasings() -> None:
    assert len({name for w in wishes() for name in w.by}) >= 100
    assert len({text for w in wishes() for text in w.say}) == sum(len(w.say) for w in wishes()) >= 300


def test_words_have_plurals_and_articles() -> None:
    assert plural("person") == "people"
    assert plural("bench") == "benches"
    assert article("apartment block") == "an apartment block"
    assert article("university") == "a university"
