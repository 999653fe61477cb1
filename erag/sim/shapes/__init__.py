"""The builders of all object classes, by class name: one small function each, in modules by family."""

from __future__ import annotations

from collections.abc import Mapping

from erag.sim.model import Builder
from erag.sim.shapes import buildings, furniture, household, leisure, signs, square, street, trade, vegetation, vehicles

_FAMILIES = (street, square, vegetation, vehicles, buildings, furniture, household, trade, signs, leisure)
BUILDERS: Mapping[str, Builder] = {f.__name__.replace("_", " "): f for family in _FAMILIES for f in family.BUILDERS}
