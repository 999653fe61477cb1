"""The words of the simulator: its YAML files, read safely and checked, and the object classes they define."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import ConfigError

Model = TypeVar("Model", bound=BaseModel)


def read_words(name: str) -> dict[str, Any]:
    """The content of `words/<name>.yaml`."""
    return parse((resources.files("erag.sim") / "words" / f"{name}.yaml").read_text("utf-8"), f"{name}.yaml")


def parse(text: str, where: str) -> dict[str, Any]:
    """A YAML mapping, read by the safe loader. Raises ConfigError if it is none."""
    try:
        raw = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"not YAML: {error}", where=where) from None
    if not isinstance(raw, dict):
        raise ConfigError("not a mapping", where=where, allowed="key: value")
    return raw


def validated(model: type[Model], raw: object, where: str) -> Model:
    """`raw` as a `model`. Raises ConfigError naming the first field that is wrong."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        at = ".".join(map(str, first["loc"]))
        raise ConfigError(
            f"{at or 'it'}: {first['msg']}", where=where, repair="docs/sim.md describes the format"
        ) from None


class Styles(BaseModel):
    """The looks of a class: shape variants, each with the word captions use for it (may be empty), and colours."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    shapes: dict[int, str] = {0: ""}
    colours: tuple[str, ...] = ()


class ObjectClass(BaseModel):
    """A class of objects: how it is called, how it may look in training and in held-out worlds, where it is found.

    `words` are further words that would give the object away in an implicit query, `is_a` classes it also counts as;
    `big` marks what may fill the view (buildings, trees) and so comes last in a caption, `mobile` what moves or goes
    between two visits, `flat` what one drives over; `height` is metres above the floor where it hangs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plural: str = ""
    family: str
    train: Styles = Styles()
    held_out: Styles | None = None
    words: tuple[str, ...] = ()
    is_a: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    big: bool = False
    mobile: bool = False
    flat: bool = False
    height: float = Field(0.0, ge=0)

    def styles(self, split: str) -> Styles:
        """The looks in the worlds of `split`: train or test."""
        return self.held_out if split == "test" and self.held_out else self.train


def plural(name: str) -> str:
    """The plural of a class's name."""
    regular = f"{name}es" if name.endswith(("ch", "sh", "s", "x")) else f"{name}s"
    return classes()[name].plural or regular


@cache
def classes() -> Mapping[str, ObjectClass]:
    """All object classes by name, from `words/classes.yaml`."""
    return {name: validated(ObjectClass, raw, f"classes.yaml: {name}") for name, raw in read_words("classes").items()}


def kin(name: str) -> tuple[str, ...]:
    """The class and those that count as one of it: an office chair is a chair, a conifer a tree."""
    return (name, *(n for n, k in classes().items() if name in k.is_a))


def article(phrase: str) -> str:
    """`phrase` with its indefinite article."""
    vowel = phrase[:1].lower() in "aeiou" and not phrase.lower().startswith(("uni", "us", "eu", "one"))
    return f"{'an' if vowel else 'a'} {phrase}"
